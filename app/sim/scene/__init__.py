"""A cell as kernel arrays.

scene  What the compiled kernels know of a work cell: its robot and its people
"""
