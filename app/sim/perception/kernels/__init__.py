"""Compiled pose fit.

pose_fit  Joint angles of a person from key-points
"""
