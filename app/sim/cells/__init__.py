"""Work cells as data.

cell    Work cells as data: what stands where, who walks there, and the limits that hold
parts   The parts of a work cell: table, obstacles, stations, goals, robot, safety, with their
        units
people  The people of a work cell: a worker with 18 joints, or one of three walking cylinders
"""
