"""Work cells as data.

cell     Work cells as data: objects, people and limits
parts    Parts of a work cell: table, obstacles, stations, goals, robot, safety
people   People of a work cell: a worker with 18 joints, or one of three kinds of pedestrians
support  Support of points in a cell: the table or an obstacle below them
"""
