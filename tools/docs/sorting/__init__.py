"""Tables, pictures and studies of the sorting scenario.

curves     Collect learning curves of the sorting task
plots      Draw the pictures of ``docs/results/sorting.md``
recording  Record the shipped policy in test 4, as in thesis figure 3.3 (a)
tables     Tables of the sorting evaluations: measures and column headers
tiny       Solve a small sorting task by value iteration, tabular Q-learning and the DQN
"""
