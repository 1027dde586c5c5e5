"""Reading and checking work cells.

checks        Validation of a work cell whose fields have the right types
places        Support of stations and people: the table, an obstacle or the floor
reachability  Reachability of points of a cell by collision-free configurations
reader        Reader of work cells from untrusted bytes
units         Bounds of the numbers of a work cell, with a guess of the unit
"""
