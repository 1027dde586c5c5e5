"""The 3D scene on viser.

capsules_view  The shapes the simulator sees, translucent over what is drawn; red where they
               touched
loop           Live cell: the thread that owns a live world and draws its scene
poses          Conversion of rotations to and from viser's order of quaternions
server         Viser's server behind a Unix socket, which no browser and no other user can
               reach
view_settings  What each visitor shows or hides in the scene, for that browser only
people/        People in the scene
robot/         The robot in the scene
scene/         The work cell in the scene
"""
