"""Compiled sorting episodes and planner.

action_costs    Expected attempts of the exact planner per first move
episode         Episodes of the sorting task, all rows at once: starts, attempts, people, ends
initial_states  Initial states of sorting episodes
interference    Interference of people with a sorting task
optimal_costs   Moves and expected attempts of the exact planner for many sorting tasks
planner         Exact plans of the sorting task
planner_batch   Exact plans of the sorting task for batches
reward          Terms of the sorting reward
shortest_paths  The sorting task as progress of its towers, and the fewest moves from there
task            Steps of sorting tasks, one attempt per row and call
tie_breaking    Selection of the next move among shortest plans, by rules of low risk
"""
