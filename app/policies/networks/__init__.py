"""Neural networks.

actor_critic  The networks of TD3: actors, and critics with layer normalisation
candidate_values
              Actions, values and predicted outcomes of a policy for picks
forward       Forward passes of small networks for decisions, without torch
one_hot       A linear layer over one-hot codes, without the zeros: compiled, with its gradient
pick          Networks of the pick scenario, and the layout of their observations
sorting_q     Networks that value the moves of the sorting task
"""
