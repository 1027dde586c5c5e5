"""Compiled sorting episodes and planner.

action_costs    What every valid move of the sorting task is worth to the exact planner,
                compiled
episode         Episodes of the sorting task, all rows at once: starts, attempts, people, ends
initial_states  How episodes of the sorting task are drawn (docs/method.md 1.4)
interference    What people do to a sorting task while the robot works (docs/method.md 1.2)
optimal_costs   What the exact planner needs from where many sorting tasks are, in one call
planner         Exact plans of the sorting task: next moves for batches, whole plans and risk,
                compiled
planner_batch   Exact plans of the sorting task for batches (compiled)
reward          The terms of the sorting reward (docs/method.md 1.3), each a function of its own
shortest_paths  The sorting task as progress of its towers, and the fewest moves from there,
                compiled
task            The sorting task in compiled rows: one attempt per row and call (docs/method.md
                1.2, 1.3) tie_breaking    Which move of the shortest plans comes next, by rules
                that keep the risk low, compiled
"""
