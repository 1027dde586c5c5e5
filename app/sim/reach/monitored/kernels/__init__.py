"""Compiled monitored reach step.

state  Data of the reach steps under speed and separation monitoring: accounts, command, results
step   Steps of the reach scenario under speed and separation monitoring
"""
