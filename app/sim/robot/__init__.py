"""The robot: model, kinematics, capsules, joint limits, actions."""
