"""People in the scene.

gait              Steps of the mannequin's feet; for display only
gizmos            Handles by which a visitor drags pelvis and hands of a person
mannequin         Surfaces, colours and skin weights of the drawn person, in eleven parts
pedestrians_view  Cylinders of pedestrians in the scene, around their mannequins
people_view       All people in the scene, created when they enter and hidden when they leave
person_view       One person in the scene: the mannequin, its feet, and the simulator's
                  capsules over it
skeleton          Bones of the mannequin: poses for a posture, and skin weights
"""
