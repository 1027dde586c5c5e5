"""The safety layer of live worlds.

explanation  Why the safety layer reduces the speed, in one sentence
layer        Safety layer of a live world: settings, planned motion, times
snapshot     State of the safety layer at one tick
"""
