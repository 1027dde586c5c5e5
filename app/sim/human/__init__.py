"""The 18-DoF human model.

anthropometry  Body sizes: lengths of the segments of the 18-DoF model
model          The 18-DoF person of docs/method.md 3.4: names, limits, capsules and inverse
               kinematics
person         One person in the cell: state of the human model, or a cylinder
kernels/       Compiled kinematics of the human model
"""
