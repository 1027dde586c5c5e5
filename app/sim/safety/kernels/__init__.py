"""Compiled separation monitoring.

adversarial_people  Adversarial people: they try to hit the robot within the assumed speed
adversarial_trials  Falsification of speed and separation monitoring by adversarial people
separation_check    Separation of a moving robot from people whose possible position grows with
                    time
ssm                 Speed and separation monitoring of one control period
"""
