"""Compiled rollout policy improvement.

actor        Actor network evaluated for few states at once
candidates   Candidate action sequences of the rollout policy improvement
improvement  Rollout policy improvement for reaching
prediction   Prediction of people for the rollout: position and radius of each person per step
rollout      Simulation and scoring of one candidate action sequence
workspace    Work space of the rollout policy improvement
"""
