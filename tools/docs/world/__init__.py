"""Validation of the simulator: measures, pictures and page.

measures  Measurements of ``docs/world.md``: numbers for its JSON file, arrays for its pictures
override  Measure the safety layer while a person approaches a moving robot
page      Validate the simulator: measure, draw and write ``docs/world.md``
plots     Pictures of ``docs/world.md``, and the plot style that all scripts of ``docs`` share
walks     Walks of one pedestrian without a robot, for plots and tests
"""
