"""Decisions of trained policies.

controllers           Controllers of the robot made of one trained policy, by inference mode
live_reach_policy     A reach policy in the live cell, with all its inference modes
motion_decision       The next piece of motion toward a goal beside people (METHOD 2.2, 2.4,
                      2.7)
reach_policy          A trained policy of the reach scenario, for inference
rollout               Rollout policy improvement of a trained reach policy
sorting_policy        A trained sorting network, for inference
target_interpolation  Actions for goals between training targets: the weighted mean of those
                      for targets around
task_selection        The critic's choice among geometric tasks (METHOD 3.1)
trained_policy        Identity of a policy that was loaded from a checkpoint
"""
