"""Compiled pose fit."""
