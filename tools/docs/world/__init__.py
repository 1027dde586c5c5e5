"""Validation of the simulator: measures, pictures and page."""
