"""A cell as kernel arrays.

scene  Kernel data of a work cell: robot and people
"""
