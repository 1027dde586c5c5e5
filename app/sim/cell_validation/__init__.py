"""Reading and checking work cells.

checks        Everything that can be wrong with a work cell whose fields have the right types
places        Support of stations and people: the table, an obstacle or the floor
reachability  Whether the robot reaches a point of its cell, in a posture that touches nothing
reader        Reading a work cell that anybody may have written: bytes in, a cell or all its
              faults out
units         Numbers of a work cell against the values they may have, with a guess at the unit
              meant
"""
