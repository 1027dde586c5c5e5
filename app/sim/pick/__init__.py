"""The pick scenario."""
