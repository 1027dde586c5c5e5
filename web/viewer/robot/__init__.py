"""The robot in the scene.

robot_body  What the UR10 looks like: its visual meshes, repainted, and a two-finger gripper
robot_view  The robot in the scene: link meshes placed from Pinocchio, and the gripper or
            magnet
"""
