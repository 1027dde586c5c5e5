"""The 3D scene on viser.

capsules_view  Collision capsules over the drawn bodies: translucent, red in contact
loop           Live cell: the thread that owns a live world and draws its scene
poses          Conversion of rotations to and from viser's order of quaternions
server         Viser's server behind a Unix socket, unreachable for browsers and other users
solid_meshes   Solids with bevelled edges and physically based materials, as binary glTF
view_settings  Parts of the scene that each visitor can show or hide in one browser
people/        People in the scene
robot/         The robot in the scene
scene/         The work cell in the scene
"""
