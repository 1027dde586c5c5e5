"""Compiled collision checks."""
