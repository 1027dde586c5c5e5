"""Sampling-based planning, time parameterization, path tracking.

goal_configurations    Joint configurations that bring the tool to a target: the goals of the
                       planners
ompl_planners          Sampling-based planners: OMPL with the project's collision checker
path_tracking          Path following: tracks a timed path from the robot's actual position,
                       period by period
replanning             Replanning executors: planners in three roles, in place of a policy
time_parameterization  From a path of straight joint motions to one timed within the limits, in
                       exact segments
"""
