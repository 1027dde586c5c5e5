"""The live reach world.

commands     Commands to a live reach cell; see ``app/live/commands.py``
controller   Controller of a live reach cell: a reach policy, or straight motion in joint space
explanation  Status messages of a live reach cell, one sentence each
goal         Goal of a live reach cell: position and choice of the next one
interfaces   Interface of policies of a live reach cell; ``app.policies`` implements it
snapshot     State of a live reach cell beyond robot and people: goal, inference mode, outcomes
world        Live reach world: the robot moves from goal to goal beside walking people
"""
