"""Decisions: what the robot does next, from a state in the body.

motion          Motion decisions: the next trajectory segment toward a goal (thesis chapter
                4)
plan            Next move of a sorting task with its motion, by the pick policy's critic
risk_map        Choice and risk over a grid of positions of a person
sorting         Sorting decisions: the next move of a sorting task (thesis chapter 3)
task_selection  Task selection by the critic's values (thesis chapter 5)
"""
