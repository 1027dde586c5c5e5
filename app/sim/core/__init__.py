"""Arrays, compilation, random numbers, trigonometry.

arrays              Array types of the simulator
jit                 Compilation of kernels: cached on disk, and without reference counting
kernel_cache        Where compiled kernels are kept between runs
observation_layout  Where each group of features stands in an observation
out_of_range        An input outside the training range or the joint limits
kernels/            Compiled random numbers and trigonometry
"""
