"""Decisions of trained policies."""
