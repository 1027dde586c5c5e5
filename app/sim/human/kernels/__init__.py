"""Compiled kinematics of the human model."""
