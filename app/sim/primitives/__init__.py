"""Probabilistic movement primitives of people."""
