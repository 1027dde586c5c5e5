"""Compiled motion of people.

motion      Motion of the people in a cell
pedestrian  Pedestrian: a vertical cylinder with pseudo-random speed and radius
people      State and collision geometry of the people in a cell
speeds      Speeds of the people in a cell
yielding    Yielding of a person to the robot arm
"""
