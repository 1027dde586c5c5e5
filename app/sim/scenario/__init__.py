"""Common parts of the scenarios.

batch        Many environments of one scenario, stepped together by one thread
monitoring   Episodes of any scenario under speed and separation monitoring: settings, state,
             results
step_result  Result of one batched step
kernels/     Compiled episode steps that the scenarios share
"""
