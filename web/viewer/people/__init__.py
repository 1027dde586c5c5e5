"""People in the scene.

gait              Steps of the mannequin's feet: cosmetic, so that a person who is moved does
                  not slide
gizmos            Handles on a person: pelvis and both hands, for a visitor to drag in manual
                  mode
mannequin         What the person looks like: eleven parts, ready to be drawn
pedestrians_view  Pedestrians in the scene, as cylinders: what counts of people, around their
                  mannequins
people_view       The people in the scene: each is drawn while present, and hidden afterwards
person_view       One person in the scene: the mannequin, its feet, and the simulator's
                  capsules over it
skeleton          The bones inside the mannequin: where each is for a posture, and which skin
                  follows which
"""
