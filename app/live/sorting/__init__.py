"""The live sorting world.

benchmark_run      What a live sorting cell begins with: a random task, or one of the six tests
commands           Commands to a live sorting cell; see ``commands.py``
controller         Choice of moves in a live sorting cell: by the monitored sorting policy, or
                   by the planner
explanation        Status messages of a live sorting cell, one sentence each
perceived_state    Puts the sorting task of a live cell into a snapshot
snapshot           State of the sorting task of a live cell at one tick
table              The blocks of a live sorting cell, its goal, and what robot and people do to
                   them
vertical_approach  The last centimetres to a block or a place, and back up, by inverse
                   kinematics
world              Live sorting world: the robot executes the moves that policy or planner
                   choose
"""
