"""Training runs.

curve         Greedy episodes behind a point of a learning curve, the same ones at every
              point
file_store    Stores of files that are named by their SHA-256; a folder is one
memory_files  Replay memory on disk: files of transitions named by their SHA-256, written
              incrementally
outcome       Fit of outcome probabilities to episodes of the finished policy
pick          Training on the pick scenario: settings, networks, exploration and learning curve
progress      Points of the learning curve of a training, and its result
reach         Training on the reach scenario: settings, networks, exploration and learning curve
reporter      Reports between two steps of a training: learning curve, checkpoints, stop
run           One attempt at a training of any scenario: counters, checkpoints and states
sorting       Training on the sorting task: model, checkpoints, curriculum and learning curve
state         State of a training, from which it continues with the same result
state_folder  States of one training in a folder, for trainings without a server
td3           The TD3 set-up of the pick and the reach scenario: model, checkpoints and
              monitored data
train         The one training path: from a preset and a seed to checkpoints
"""
