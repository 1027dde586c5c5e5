"""Prediction of human motion."""
