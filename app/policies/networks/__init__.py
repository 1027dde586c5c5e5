"""Neural networks.

actor_critic  The networks of TD3: actors with a residual action and its fading, critics with
              layer normalisation and the least of them
candidate_values
              Actions, values and predicted outcomes of a policy for picks
ddpg          Networks of DDPG as Stable-Baselines 2 makes them, for the recipes of the thesis
forward       Forward passes of small networks for decisions, without torch
large_pages   Arrays in large memory pages
one_hot       Sparse linear layer over one-hot codes, compiled, with its gradient
outcome       Probabilities of the outcomes of a pick, and its expected time
pick          Networks of the pick scenario, and the layout of their observations
quantiles     Truncated quantile critics: distributional critics without the highest quantiles
              in targets
sorting_q     Networks that value the moves of the sorting task
"""
