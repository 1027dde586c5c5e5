"""Sampling-based planning, time parameterization, path tracking.

goal_configurations    Joint configurations that bring the tool to a target: the goals of the
                       planners
ompl_planners          Sampling planners to compare policies with: OMPL on our own collision
                       checker (docs/method.md 2.6)
path_tracking          Path following: tracks a timed path from the robot's actual position,
                       period by period
replanning             Replanning executors: planners in three roles, in place of a policy
                       (docs/method.md 2.6)
time_parameterization  From a path of straight joint motions to one timed within the limits, in
                       exact pieces
"""
