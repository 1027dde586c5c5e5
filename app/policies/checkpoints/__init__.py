"""Checkpoint files and what they state."""
