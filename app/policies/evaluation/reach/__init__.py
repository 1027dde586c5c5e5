"""Evaluation of the reach scenario.

bench         What the protocols of the reach scenario share: a policy, its cell, its rules,
              its rows
episodes      Run reach episodes to their ends under any controller, and count the outcomes
oracle        Protocol ``reach-oracle``: upper bound of success by search with a known future
people        Protocols ``reach-people``, ``reach-constant`` and ``reach-speeds``: other people
random_goals  Protocol ``reach-random``: goals anywhere in the box, which no grid holds
smoothness    Protocol ``reach-smoothness``: what the joints do along whole episodes
ssm           Protocol ``reach-ssm``: a policy and planners under the same safety layer (METHOD
              2.6)
targets       Protocol ``reach-targets``: every training target of the source, beside one
              walking person
tracker       Protocol ``reach-tracker``: what a policy loses when it sees people through a
              tracker
"""
