"""Depth to which the tool goes down at an object, for kernels and for the check of cells."""

PICK_DEPTH_M = 0.055
"""Descent from the position of a cube or dock to the object [m]: from 0.12 to 0.065 m over the
table."""
