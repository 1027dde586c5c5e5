"""Compiled pick episodes.

episode         Episodes of the pick scenario: starts, steps, ends and rewards (compiled)
monitored_step  Steps of the pick scenario under speed and separation monitoring (compiled)
observation     Observation of the pick scenario: state of robot, person and target as features
                (compiled)
reward          Reward of the pick scenario (docs/method.md 3.3, compiled)
"""
