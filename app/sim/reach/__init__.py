"""The reach scenario.

batch          The reach scenario of thesis chapter 4: a robot reaches goals beside people who
               walk about
blocked_batch  Reach environments of the authors' recipe, in which a contact blocks the arm
crossings      People who cross between the robot and its goal: the episodes of ``reach-ssm``
goal_sets      Training targets in a box of goals, and interpolation between them
mixed_batch    Reach environments with different numbers of people, stepped together
motion_types   Query and result of a motion decision of a reach policy
oracle_search  Oracle search: what is possible with knowledge of the future motion of people
query_state    One state that a client sends, observed as the reach scenario's policies observe
               it
reach_actor    Interface of a policy that brings the tcp to a goal
recipe_rules   Rules of the recipes of the thesis: blocked arms and joint limits
kernels/       Compiled reach episodes
monitored/     The reach scenario under speed and separation monitoring
rollout/       Rollout policy improvement for reaching
"""
