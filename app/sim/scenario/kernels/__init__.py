"""Compiled episode steps that the scenarios share."""
