"""The simulator. Imports no torch, no web framework and no database.

cell_validation/  Reading and checking work cells
cells/            Work cells as data
collision/        Collision checks
core/             Arrays, compilation, random numbers, trigonometry
envs/             Gymnasium environments; importing this package registers their ids, single
                  and batched
geometry/         Distances between segments, capsules, boxes and cylinders (compiled)
human/            The 18-DoF human model
mocap/            Import of recorded human motion
people/           Motion of people in the cell
perception/       From key-points and cylinders of a tracker to people
pick/             The pick scenario
planning/         Sampling-based planning, time parameterization, path tracking
prediction/       Prediction of human motion
primitives/       Probabilistic movement primitives of people
reach/            The reach scenario
robot/            The robot: model, kinematics, capsules, joint limits, actions
safety/           Speed and separation monitoring; power and force limiting
scenario/         What the scenarios share
scene/            A cell as kernel arrays
sorting/          The sorting scenario
"""
