"""Evaluation: one module per protocol; each prints rates with 95 % intervals."""
