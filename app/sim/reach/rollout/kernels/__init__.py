"""Compiled rollout policy improvement.

actor        Actor network evaluated for few states at once (compiled)
candidates   Candidate action sequences of the rollout policy improvement (compiled)
improvement  Rollout policy improvement for reaching (compiled)
prediction   Prediction of people for the rollout: position and radius of each person per step
             (compiled)
rollout      Simulation and scoring of one candidate action sequence (compiled)
workspace    Work space of the rollout policy improvement (compiled)
"""
