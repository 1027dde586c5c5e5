"""The live pick-and-place world."""
