"""Compiled monitored reach step."""
