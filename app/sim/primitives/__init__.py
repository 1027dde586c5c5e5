"""Probabilistic movement primitives of people.

augmentation       Variation of the elbow along the same palm path, an augmentation of
                   demonstrations
demonstrations     Synthetic demonstrations: reaches of a person between two places of a cell
library_file       Shipped task primitives: one movement primitive per segment of a worker's
                   task
phase              Minimum-jerk phase of a motion
primitive_library  Motion library of a worker: keyframe postures and samples of task primitives
promp              Probabilistic movement primitives: a normal distribution over a person's
                   trajectories
kernels/           Compiled movement primitives and scripts
"""
