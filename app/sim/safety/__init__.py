"""Speed and separation monitoring; power and force limiting.

adversarial_trials  Falsification trials of the safety layer: many episodes with adversarial
                    people
contact_limits      Speed limits of contact by body part (power and force limiting)
decision            Decision of the safety layer for one period, and the terms of the separation
                    distance
layer               Speed and separation monitoring, and power and force limiting, for any
                    policy or planner; the terms S_h, S_r and B for displays
separation_zone     The protective separation distance around the whole robot, as a zone on the
                    floor
kernels/            Compiled separation monitoring
"""
