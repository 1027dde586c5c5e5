"""Prediction of human motion.

weights   Networks of the shipped motion predictor, from ``forecasts_data/walker.npz``
kernels/  Compiled predictors
"""
