"""The sorting scenario.

batch               Batch of sorting tasks
benchmark_tasks     The six tests of the sorting task: initial states and interference of people
decision            Decision about the next sorting move, by a policy or the exact planner
decision_types      Data of a decision about the next sorting move
layout              Geometry of a sorting cell: blocks, tool positions, and the work of people
names               Names of colours, sizes and positions of a sorting task, and states written
                    in them
near_optimal_moves  Sorting moves that the exact planner expects to take about as many attempts
                    as its own
planner             Exact planner of the sorting task: fewest moves, with few expected attempts
progress_monitor    Loop and stall monitor of a sorting policy: when the exact planner takes
                    over
sorting_values      Interface of a learned policy for sorting: its values of all moves
state               State of the sorting task as integers, and its moves
kernels/            Compiled sorting episodes (moves, failures, observation) and planner
"""
