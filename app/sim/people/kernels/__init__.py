"""Compiled motion of people."""
