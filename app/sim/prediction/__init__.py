"""Prediction of human motion.

weights   Networks of the shipped motion predictors, from ``data/``
kernels/  Compiled predictors
"""
