"""Compiled reach episodes.

base_controller        Base controller of the reach scenario, and features of the approach of a
                       person
episode                Episodes of the reach scenario: starts, steps, ends and rewards
interpolation_weights  Interpolation weights of a goal between training targets
observation            Observation of the reach scenario: the raw state, or the raw state and
                       features
observation_workspace  Work space in which observations of the reach scenario are computed
option_features        Option features: predicted clearance along five candidate motions
people_set             People of the cell as a set, for networks that take a set
queries                Observations of the reach scenario, for the goals of the episodes or
                       others
query_state            Clearances of a state that a client sends, before a motion decision
reward                 Reward of the reach scenario
"""
