"""Work cells as data.

cell     Work cells as data: objects, people and limits
colours  Colours of the bodies of a cell, in images of environments and in the 3D scene
parts    Parts of a work cell: table, obstacles, stations, goals, robot, safety
people   People of a work cell: a worker with 18 joints, or one of three kinds of pedestrians
support  Support of points in a cell: the table or an obstacle below them
"""
