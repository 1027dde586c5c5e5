"""The robot in the scene."""
