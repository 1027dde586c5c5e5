"""Compiled predictors.

networks    Motion predictor: radius and path length of a pedestrian from its recent motion
            (compiled)
privileged  True future of pedestrians, as privileged observation of a critic (compiled)
"""
