"""Evaluation of the sorting scenario."""
