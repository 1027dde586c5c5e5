"""People in the scene."""
