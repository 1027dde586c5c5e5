"""The sorting scenario."""
