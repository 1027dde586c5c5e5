"""The live sorting world."""
