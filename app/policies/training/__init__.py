"""Training runs.

curve         Greedy episodes behind a point of a learning curve, the same ones at every
              point
file_store    Stores of files that are named by their SHA-256; a folder is one
memory_files  Replay memory on disk: files of transitions named by their SHA-256, written
              incrementally
outcome       Fit of outcome probabilities to episodes of the finished policy
pick          Training on the pick scenario: settings, networks, exploration and learning curve
progress      What a training tells while it runs, and how it ended
reach         Training on the reach scenario: settings, networks, exploration and learning curve
reporter      Reports between two steps of a training: learning curve, checkpoints, stop
run           One attempt at a training: its counters, checkpoints and states, whatever is
              trained
sorting       Training on the sorting task: model, checkpoints, curriculum and what its curve
              counts
state         State of a training: all that it needs to continue as if it had not been
              interrupted
state_folder  States of one training in a folder, for trainings without a server
td3           The TD3 set-up of the pick and the reach scenario: model, checkpoints and
              monitored data
train         The one training path: from a preset and a seed to checkpoints
"""
