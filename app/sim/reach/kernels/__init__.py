"""Compiled reach episodes.

base_controller        Base controller of the reach scenario, and features of the approach of a
                       person (compiled)
episode                Episodes of the reach scenario: starts, steps, ends and rewards
                       (compiled)
interpolation_weights  Interpolation weights of a goal between training targets (compiled)
observation            Observation of the reach scenario: the raw state, or the raw state and
                       features (compiled)
observation_workspace  Work space in which observations of the reach scenario are computed
                       (compiled)
option_features        Option features: predicted clearance along five candidate motions
                       (compiled)
people_set             People of the cell as a set, for networks that take a set (compiled)
queries                Observations of the reach scenario, for the goals of the episodes or
                       others (compiled)
query_state            Clearances of a state that a client sends, before a motion decision
                       (compiled)
reward                 Reward of the reach scenario (docs/method.md 2.3, compiled)
"""
