"""Compiled kinematics, action bounds and speed override.

acceleration_bounds  Bounds of quadratic joint trajectories for one control period
actions              Motion of the joints in one period that an action of a policy commands
arm                  The robot in its cell: limits, capsules, poses, clearances and speed bounds
configuration_lanes  Clearances of several configurations, each to its own cylinder
jerk_bounds          Bounds of cubic, jerk-limited trajectories of one joint
joints               Limits, states and trajectories of the robot's joints, as tuples that
                     kernels take
kinematics           Forward and inverse kinematics of robots of the UR family
override             Trajectory of one period executed at reduced speed along its own path
"""
