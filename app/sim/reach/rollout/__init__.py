"""Rollout policy improvement for reaching."""
