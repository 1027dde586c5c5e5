"""The robot in the scene.

robot_body  Visual meshes of the UR10, of the gripper and of the magnet
robot_view  The robot in the scene: link meshes placed from Pinocchio, and the gripper or
            magnet
"""
