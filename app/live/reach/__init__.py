"""The live reach world."""
