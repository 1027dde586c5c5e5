"""Distances between segments, capsules, boxes and cylinders (compiled)."""
