"""Compiled monitored reach step.

step  Steps of the reach scenario under speed and separation monitoring (compiled)
"""
