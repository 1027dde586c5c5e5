"""Checkpoint files: format, upload, training cell and training range.

checkpoint      Checkpoint format: tensors as safetensors, everything else as a JSON manifest
files           Checkpoints as files: a reader gets tensors and manifest of one checkpoint
model_state     Tensors of networks and optimisers in checkpoints, and versions of packages
trained_cell    Training cell of a checkpoint
trained_values  Training range of a reach policy, to flag inputs outside it
training_range  Minimum and maximum of every state variable in training, for manifests
upload          Checkpoints from outside: manifest and safetensors file in one body
pretrained/     Shipped checkpoints: tensors, manifest and model card of each
"""
