"""Estimation of people from key-points and cylinders of a tracker.

bounding_cylinder      The safety volume of docs/method.md 2.8: an upright cylinder around a
                       person's key-points
cylinder_sensor_model  Sensor model of a tracker of pedestrians, for a batch of environments
kalman_filter          Kalman filters of points with latency, noise and missing measurements
keypoint_angles        The 18 joint angles of our person from key-points, in closed form
keypoint_check         Validation of received key-points: missing and unusable points, wrong
                       frames and units
keypoint_sensor_model  Sensor model of a key-point tracker
keypoints              Key-points of a depth camera in the layout BODY_25: names, sides, our
                       body's own
multi_person_tracker   Tracking of several people from frames of key-points: data association
                       and track management
observed_people        Validation of people received from outside, and their form as policy
                       observations
person_estimator       Estimation of one person from key-points: safety cylinder and 18 joint
                       angles with speeds
single_frame           A person from one frame of key-points, without history
stamp_timeline         One timeline for the frames of a tracker, from their stamps and their
                       arrivals
kernels/               Compiled pose fit
"""
