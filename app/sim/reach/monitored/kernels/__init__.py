"""Compiled monitored reach step.

state  Data of the steps: accounts, command, results
step   Steps of the reach scenario under speed and separation monitoring (compiled)
"""
