"""Compiled reach episodes."""
