"""Evaluation of the reach scenario."""
