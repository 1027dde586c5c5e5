"""Compiled collision checks.

contact  Contact test of one control period, compiled: finds every contact, to 1 ms
free     Collision check of planners: clearance at a configuration and along a motion
"""
