"""The reach scenario under speed and separation monitoring.

batch     The reach scenario under speed and separation monitoring
planners  Planners in place of a policy, under the same safety layer and limits (docs/method.md
          2.6)
kernels/  Compiled monitored reach step
"""
