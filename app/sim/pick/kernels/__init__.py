"""Compiled pick episodes.

base_motion            Straight joint move to which the actor adds its residual
candidates             Observation of several candidates in one call
episode                Steps, ends and rewards of episodes
grasp                  Phases of a pick
monitored_step         Steps under speed and separation monitoring
observation            State of robot, people and target as features
observation_layout     Groups of features and their units
observation_workspace  Query and work space of observations
reward                 Reward (docs/method.md 3.3)
second_person          The second person of an observation
starts                 Targets, candidates and starts of episodes
"""
