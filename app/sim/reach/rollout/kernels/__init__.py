"""Compiled rollout policy improvement."""
