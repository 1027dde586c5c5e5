"""The reach scenario."""
