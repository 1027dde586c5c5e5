"""Compiled movement primitives and scripts.

primitives  Segments of task primitives between places, sampled and conditioned on both ends
script      Scripts of minimum-jerk moves between postures, and their random generation
"""
