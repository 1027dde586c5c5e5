"""Compiled episode steps that the scenarios share.

episode             State and step that the pick and reach scenarios share
person_observation  Motion of an observed person, as both scenarios extrapolate it
"""
