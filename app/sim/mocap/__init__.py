"""Import of recorded human motion.

artifacts           Detection of motion-capture artefacts by speed, and the clean runs between
                    them
bvh                 Reading BVH files: a skeleton as a tree of joints, and its channels frame
                    by frame
csv_tables          Joint angles in tables: CSV with our own columns
csv_text            The text of a CSV file as spreadsheets, statistics programs and people
                    write it
importer            Import of recorded human motion as clean runs of the 18-DoF model
inverse_kinematics  From joint centres to the 18 angles, in closed form (docs/method.md 3.4)
joint_centres       Joint centres of a recorded person, frame by frame, and the body measured
                    from them
joint_names         Which joint of a recorded skeleton is which, by the names of the skeletons
                    in common use
length_units        The unit of a recorded skeleton, and whether the root's path is in the same
opensim             Reading OpenSim's tables of joint angles (``.mot``, ``.sto``) onto the
                    18-DoF model
read_options        What a caller states about a recording, and how it was read: units, axis,
                    names
repeated_frames     Motion that was written at a higher rate than recorded, by repeating frames
skeletons           From a recorded skeleton to a person's joint centres in metres, z up
tables              Tables of joint angles as other programs write them: columns by name,
                    missing values found
up_axis             Which axis of a recording points up
"""
