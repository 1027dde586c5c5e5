"""Compiled collision checks.

contact  Contact test of one control period, compiled: early by a millimetre at most, never late
free     Collision check of planners: clearance at a configuration and along a motion
"""
