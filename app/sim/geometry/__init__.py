"""Distances between segments, capsules, boxes and cylinders (compiled).

box       Exact distances of capsules to boxes rotated about the vertical
capsules  Sets of capsules as structures of arrays, and exact distances between them
cylinder  Exact distances of capsules to a solid vertical cylinder that stands on the floor
segments  Nearest points of two segments; one pair at a time, for directions and names
"""
