"""Import of recorded human motion: BVH, OpenSim and CSV files.

artifacts           Detection of motion-capture artefacts by speed, and the clean runs between
                    them
bvh                 Reader of BVH files
csv_tables          Reader of joint angles in CSV files with the columns of this project
csv_text            Reader of CSV text of spreadsheets and statistics programs
faults              Errors of recordings: place, value and rule
importer            Import of recorded human motion as clean runs of the 18-DoF model
inverse_kinematics  Inverse kinematics from joint centres to the 18 angles, in closed form
joint_centres       Joint centres of a recorded person over time, and body lengths measured
joint_names         Identification of the joints of a recorded skeleton by name
length_units        Units of a recorded skeleton and of its root's path
opensim             Reader of OpenSim's tables of joint angles (``.mot``, ``.sto``)
read_options        Stated properties of a recording and its interpretation
repeated_frames     Removal of repeated frames
skeletons           Conversion of a recorded skeleton to joint centres in metres, z up
tables              Tables of joint angles of other programs, with columns by name
up_axis             Detection of the up axis of a recording
"""
