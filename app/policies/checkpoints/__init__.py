"""Checkpoint files and what they state.

checkpoint      The checkpoint format: tensors as safetensors, everything else as a JSON
                manifest
model_state     What a checkpoint holds of a model under training: networks, optimisers,
                versions
trained_cell    The work cell that a checkpoint was trained in
trained_values  Training range of a reach policy, to flag inputs outside it
training_range  Least and greatest value of every state variable met in training, for manifests
pretrained/     The shipped checkpoints, each as tensors, manifest and model card of one name
"""
