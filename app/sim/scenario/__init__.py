"""Common parts of the scenarios.

batch     Many environments of one scenario, stepped together by one thread
kernels/  Compiled episode steps that the scenarios share
"""
