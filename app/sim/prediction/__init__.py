"""Prediction of human motion.

weights   Networks of the shipped motion predictor, from ``data/walker.npz``
kernels/  Compiled predictors
"""
