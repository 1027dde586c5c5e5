"""Falsification of the safety layer."""
