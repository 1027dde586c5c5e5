"""Compiled sorting episodes and planner.

action_costs    Expected attempts of the exact planner per first move
episode         Episodes of all environments: starts, attempts, interference and ends
initial_states  Initial states of sorting episodes
interference    Interference of people with a sorting task
optimal_costs   Moves and expected attempts of the exact planner for many sorting tasks
planner         Exact plans of the sorting task
planner_batch   Exact plans of the sorting task for batches
reward          Terms of the sorting reward
shortest_paths  State graph of a sorting task, and the fewest moves to its goal
task            Attempts in sorting environments, their rewards and observations
tie_breaking    Selection of the next move among shortest plans, by rules of low risk
"""
