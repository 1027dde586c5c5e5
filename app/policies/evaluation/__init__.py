"""Evaluation: one module per protocol; results carry rates with 95 % intervals.

contact_recheck
            Poses of robot and people, recorded and checked again with FCL
registry    All protocols by name, as the command line and evaluation jobs know them
rows        Input of a protocol, and rows that are reported as soon as they are measured
statistics  Rates and means with 95 % intervals, as results carry them
pick/       Evaluation of the pick scenario
reach/      Evaluation of the reach scenario
safety/     Falsification of the safety layer
sorting/    Evaluation of the sorting scenario
"""
