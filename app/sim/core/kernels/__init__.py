"""Compiled random numbers and trigonometry."""
