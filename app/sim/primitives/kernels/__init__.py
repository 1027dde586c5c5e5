"""Compiled movement primitives and scripts."""
