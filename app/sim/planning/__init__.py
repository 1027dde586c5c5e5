"""Sampling-based planning, time parameterization, path tracking."""
