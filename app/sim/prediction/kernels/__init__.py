"""Compiled predictors.

networks  Motion predictor: radius and path length of a pedestrian from its recent motion
worker    Motion predictor of workers: joint positions from posture and speed
"""
