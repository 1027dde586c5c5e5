"""Compiled monitored reach step.

state  Commands and results of the reach steps under speed and separation monitoring
step   Steps of the reach scenario under speed and separation monitoring
"""
