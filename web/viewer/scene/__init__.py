"""The work cell in the scene.

arc             Dashed arc from the position of an object to its target
blocks_view     Blocks in the scene: created once, moved afterwards, clickable
cell_scene      Scene of a live cell, drawn from one snapshot
clutter_view    Clutter slots in the scene, coloured by failure probability
goal_gizmo      Goal of a reach cell in the scene: point, tolerance and handle for dragging
reach_scene     Scene of a reach cell: goal, targets, path of the tool, separation zone
risk_view       Risk map in the scene: probability of contact over positions of a person
sorting_bodies  Meshes and colours of blocks, towers and clutter slots
sorting_scene   Scene of a sorting cell: clutter slots, towers, blocks and the current move
stations_view   Cubes and docks in the scene: coloured, labelled, clickable
towers_view     Towers in the scene: base plates, and missing goal blocks as translucent blocks
workplace       Static parts of the scene: floor, table, light, background, initial camera
"""
