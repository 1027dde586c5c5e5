"""A trained sorting network, for inference.

Source: docs/method.md 1.4; the tensors are data, see ``checkpoint.py``.
"""

import numpy as np
import torch
from numpy.typing import NDArray

from app.errors import CheckpointMismatch, InvalidInput
from app.policies.checkpoints.checkpoint import (
    SORTING,
    Checkpoint,
    expect_layout,
    require_purpose,
)
from app.policies.checkpoints.model_state import tensors_under
from app.policies.configs.fields import read_config
from app.policies.configs.sorting import SortingPreset
from app.policies.inference.trained_policy import TrainedPolicy
from app.policies.networks.sorting_q import NETWORKS, layout_of
from app.sim.sorting.batch import Obs, batch_in, shape_of
from app.sim.sorting.state import SortingShape

_N_PROBED = 32
"""Number of tasks by which the values of a policy are checked."""


class SortingPolicy(TrainedPolicy):
    """Sorting policy of a checkpoint; safe to call from several threads.

    Args:
        checkpoint: A ``policy`` checkpoint of a sorting preset.

    Raises:
        CheckpointMismatch: The checkpoint has another task, network or layout.
    """

    def __init__(self, checkpoint: Checkpoint) -> None:
        require_purpose(checkpoint, SORTING)
        manifest = checkpoint.manifest
        preset = read_config(SortingPreset, manifest["preset"], "manifest.preset")
        super().__init__(checkpoint)
        self.shape: SortingShape = shape_of(self._cell)
        """Size of the tasks."""
        expect_layout(checkpoint, layout_of(self.shape), self.shape.n_actions)
        self._network = NETWORKS[preset.networks.kind](self.shape, preset.networks.width)
        try:
            self._network.load_state_dict(tensors_under(checkpoint.arrays(), "q"))
        except RuntimeError as error:
            raise CheckpointMismatch("tensors", "those of q", str(error)) from error
        self._network.eval()

    def values(self, obs: Obs) -> NDArray[np.float32]:
        """Return the values of all moves, shape (n, n_actions).

        Args:
            obs: Observations as ``sorting.observe`` makes them, shape (n, obs_size).

        Raises:
            InvalidInput: The shape is another one.
        """
        if obs.ndim != 2 or obs.shape[1] != self.shape.obs_size:
            wanted = ["n", self.shape.obs_size]
            raise InvalidInput("obs", list(obs.shape), f"must have the shape {wanted}")
        with torch.inference_mode():
            found: NDArray[np.float32] = self._network(torch.as_tensor(obs)).numpy()
        return found

    def require_finite(self) -> None:
        """Check that the values of moves are finite in tasks of the training cell.

        Raises:
            CheckpointMismatch: A value is not finite: sums of large weights overflow.
        """
        tasks = batch_in(self._cell, _N_PROBED, seed=0)
        if not np.isfinite(self.values(tasks.reset())).all():
            raise CheckpointMismatch("value", "finite numbers", "NaN or infinite")
