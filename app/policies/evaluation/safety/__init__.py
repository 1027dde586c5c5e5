"""Falsification of the safety layer.

ssm  Protocol ``safety-ssm``: falsification of speed and separation monitoring
"""
