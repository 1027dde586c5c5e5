"""Compiled episode steps that the scenarios share.

episode             State and step that the pick and reach scenarios share
monitored_motion    Motion of a control period under speed and separation monitoring (compiled)
monitored_state     Safety layer and accounts of episodes under speed and separation monitoring
person_observation  Motion of an observed person, as both scenarios extrapolate it
"""
