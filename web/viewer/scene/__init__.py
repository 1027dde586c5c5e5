"""The work cell in the scene."""
