"""Compiled kinematics of the human model.

joint_angles  From directions of limbs to the angles of the 18-DoF person
kinematics    Forward kinematics and capsules of the 18-DoF human of any size
"""
