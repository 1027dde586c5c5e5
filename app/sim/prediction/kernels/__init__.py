"""Compiled predictors."""
