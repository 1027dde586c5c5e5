"""Checkpoint files: format, upload, training cell and training range.

checkpoint      Checkpoint format: tensors as safetensors, everything else as a JSON manifest;
                its id (SHA-256)
files           Checkpoints as files: a reader gets tensors and manifest of one checkpoint
manifest_rules  Rules of the values in a checkpoint's manifest, which may come from outside
model_state     Tensors of networks in checkpoints, and versions of packages
trained_cell    Training cell of a checkpoint
training_range  Minimum and maximum of every state variable in training, for manifests and
                decisions
upload          Checkpoints from outside: manifest and safetensors file in one body
pretrained/     Shipped checkpoints: tensors, manifest and model card of each
"""
