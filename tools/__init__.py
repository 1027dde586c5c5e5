"""Offline generators, run by hand."""
