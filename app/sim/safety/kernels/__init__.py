"""Compiled separation monitoring."""
