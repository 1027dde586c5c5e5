"""Compiled episode steps that the scenarios share.

episode             State and step that the pick and reach scenarios share (compiled)
person_observation  Motion of an observed person, as both scenarios extrapolate it (compiled)
"""
