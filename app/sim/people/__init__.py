"""Motion of people in the cell.

human_motion_config  Configuration of the workers' motion, body sizes and yielding, and its data
                     for the kernels
off_task_motion      Off-task motion: people that stand, turn away, or hold hands above the
                     table
pedestrian           Settings of pedestrians, people as vertical cylinders that walk
reach_script         Synthetic reaches by inverse kinematics: home, cube, dock and back
kernels/             Compiled motion of people
"""
