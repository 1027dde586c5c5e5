"""The 3D scene on viser.

capsules_view  The shapes the simulator sees, translucent over what is drawn; red where they
               touched
loop           The live cell: one thread that owns world and scene, and a door for everybody
               else
poses          Rotations on their way to viser and back: the one place that knows its
               quaternion order
server         Viser's server behind a Unix socket, which no browser and no other user can
               reach
view_settings  What each visitor may show or hide over the scene, each for himself
people/        People in the scene
robot/         The robot in the scene
scene/         The work cell in the scene
"""
