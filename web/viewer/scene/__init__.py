"""The work cell in the scene.

arc             A dashed arc in the scene, from where something is to where it goes
blocks_view     The blocks in the scene: each is made once, moved while it lives, and clickable
cell_scene      The live cell as a picture: everything that moves, drawn from one snapshot
clutter_view    The clutter slots in the scene: a map of where grasps fail, as tiles on a tray
goal_gizmo      The goal of a reach cell in the scene: a point, its tolerance, and a handle to
                drag it with
reach_scene     A reach cell in the scene: goal, targets, the way of the tool, the separation
                zone
risk_view       Risk map in the scene: the probability of a contact by the place where the
                person stands
solid_meshes    Plain solids with soft edges, painted with physical materials, as binary glTF
sorting_bodies  What blocks, towers and clutter slots look like, and the colours of the failure
                map
sorting_scene   A sorting cell in the scene: clutter, towers, blocks, and the move that is
                carried out
stations_view   Cubes and docks in the scene: each in its own colour, labelled, and clickable
towers_view     Towers in the scene: their base plates, and what they shall be as translucent
                blocks
workplace       What stands still in the scene: floor, table, light, background and the first
                camera
"""
