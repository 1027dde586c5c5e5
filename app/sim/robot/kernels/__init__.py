"""Compiled kinematics, action bounds and speed override."""
