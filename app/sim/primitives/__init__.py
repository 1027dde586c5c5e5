"""Probabilistic movement primitives of people.

keyframes          Keyframes: postures of a person with one palm at a place of a cell
library_file       Shipped task primitives: one movement primitive per segment of a worker's
                   task
phase              Minimum-jerk phase of a motion
primitive_library  Primitive library of a worker: keyframe postures and samples of primitives
promp              Probabilistic movement primitives: a normal distribution over a person's
                   trajectories
kernels/           Compiled movement primitives and scripts
"""
