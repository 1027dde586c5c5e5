"""The live pick-and-place world.

explanation  Status messages of a live pick cell, one sentence each
world        Live pick-and-place world
"""
