"""Collision checks."""
