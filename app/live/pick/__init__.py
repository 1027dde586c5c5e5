"""The live pick-and-place world.

explanation  Status messages of a live pick cell, one sentence each
risk_worker  Maps of choice and risk for a live cell, computed in a thread of their own
world        Live pick-and-place world
"""
