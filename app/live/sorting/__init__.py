"""The live sorting world.

benchmark_run      Start of a live sorting task: a random one, or one of the six tests
commands           Commands to a live sorting cell; see ``app/live/commands.py``
controller         Choice of moves in a live sorting cell: by the monitored sorting policy, or
                   by the planner
explanation        Status messages of a live sorting cell, one sentence each
snapshot           State of the sorting task of a live cell at one tick
table              Blocks and goal of a live sorting cell, and changes by robot and people
task_snapshot      Read model of the sorting task of a live cell
vertical_approach  Vertical approach to a block or place, and retreat, by inverse kinematics
world              Live sorting world: the robot executes the moves that policy or planner
                   choose
"""
