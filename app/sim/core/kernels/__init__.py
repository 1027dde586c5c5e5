"""Compiled bounds, random numbers and trigonometry.

bounds  Bounds of several variables
rng     Counter-based random numbers: a stream per (seed, environment, episode)
trig    Sines and cosines without branches, compiled to vector instructions
"""
