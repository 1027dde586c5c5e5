"""Compiled, batched kernels (numba): scalar code per environment, no allocation in loops."""
