"""Compiled motion of people.

motion      Motion of the people in a cell (compiled)
pedestrian  Pedestrian: a vertical cylinder with pseudo-random speed and radius (compiled)
people      State and collision geometry of the people in a cell (compiled)
yielding    Yielding of a person to the robot arm (compiled)
"""
