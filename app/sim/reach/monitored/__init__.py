"""The reach scenario under speed and separation monitoring.

batch     The reach scenario under speed and separation monitoring
planners  Planners in place of a policy, under the same safety layer and limits
kernels/  Compiled monitored reach step
"""
