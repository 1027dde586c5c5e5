"""Compiled pose fit.

pose_fit  The 18 joint angles of a person from key-points, compiled; see ``keypoint_angles.py``
"""
