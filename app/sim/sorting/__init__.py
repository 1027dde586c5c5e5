"""The sorting scenario.

batch             The sorting task: many of them stepped together, and what one state looks
                  like (docs/method.md 1)
benchmark_tasks   The six tests of the sorting task, as data: a start, and what a person does
                  meanwhile
decision          The next move of the sorting task, by a learned policy or by the exact
                  planner (docs/method.md 1)
decision_types    What a decision about the next sorting move says (docs/method.md 1)
layout            The geometry of a sorting cell: where blocks lie, where the tool goes, what
                  people do there
names             Names of a sorting task's colours, sizes and places, and states written in
                  them
planner           The exact planner of the sorting task: fewest moves, all best next moves, a
                  plan of low risk
progress_monitor  Loop and stall monitor of a sorting policy: when the exact planner takes over
sorting_values    Interface of a learned policy for sorting: its values of all moves state
The state of the sorting task as integers, and its moves (docs/method.md 1.1 and 1.2) kernels/
Compiled sorting episodes and planner
"""
