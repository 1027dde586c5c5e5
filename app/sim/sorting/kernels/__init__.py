"""Compiled sorting episodes and planner."""
