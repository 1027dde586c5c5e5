"""Arrays, compilation, random numbers, trigonometry.

arrays              Array types of the simulator
dispatcher          Compilation of a kernel: for Python, or as a part of other kernels
jit                 Compilation of kernels: cached on disk, and without reference counting
kernel_cache        Cache of compiled kernels between runs
observation_layout  Slices of the groups of features in an observation
out_of_range        An input outside the training range or the joint limits
pick_depth          Depth of the descent at an object
policy_identity     Interface common to all trained policies: their identity
kernels/            Compiled bounds, random numbers and trigonometry
"""
