"""Rollout policy improvement for reaching.

kernels/  Compiled rollout policy improvement
"""
