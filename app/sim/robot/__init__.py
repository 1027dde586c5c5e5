"""The robot: model, kinematics, capsules, joint limits, actions.

actions             Action types of the scenarios: degree, bounds and meaning
capsules            Capsules that contain the collision meshes of the robot and its tool, for
                    the kernels
inverse_kinematics  Configurations for positions of any orientation, by damped least squares
measured_state      Validation of a measured robot state slightly or far outside its limits
trajectory_segment  The robot's motion in one control period
ur10                The UR10 on Pinocchio: the model from which the compiled kernels take their
                    lengths
kernels/            Compiled kinematics, joint limits (their values are data of the cell),
                    action bounds and speed override
"""
