"""Compiled pick episodes."""
