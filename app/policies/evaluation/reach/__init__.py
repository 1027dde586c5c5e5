"""Evaluation of the reach scenario.

bench          Evaluate one checkpoint of the reach scenario under several rules
episodes       Run reach episodes to their ends under any controller, and count the outcomes
oracle         Protocol ``reach-oracle``: episodes that a search with a known future solves
people         Protocols ``reach-people``, ``reach-constant`` and ``reach-speeds``: other people
random_goals   Protocol ``reach-random``: random goals between the training targets
smoothness     Protocol ``reach-smoothness``: joint trajectories of whole episodes
ssm            Protocol ``reach-ssm``: a policy and planners under one safety layer
ssm_crossings  Policies, planners and an oracle on the same crossings under the safety layer
ssm_rows       Rows and comparisons of ``reach-ssm``
targets        Protocol ``reach-targets``: every training target, beside one pedestrian
tracker        Protocol ``reach-tracker``: people observed through a tracker
"""
