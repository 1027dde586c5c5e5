"""Evaluation of the pick scenario."""
