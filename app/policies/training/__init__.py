"""Training runs.

pick      Training on the pick scenario: settings, networks, exploration and learning curve
progress  What a training tells while it runs, and how it ended
reach     Training on the reach scenario: settings, networks, exploration and learning curve
reporter  Callback between two steps of a training: learning curve, checkpoints, stop
run       One attempt at a training: its counters and its checkpoints, whatever is trained
sorting   Training on the sorting task: model, checkpoints, curriculum and what its curve
          counts
td3       The TD3 set-up of the pick and the reach scenario: model, checkpoints and monitored
          data
train     The one training path: from a preset and a seed to checkpoints
"""
