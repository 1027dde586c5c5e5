"""A trained policy of the reach scenario, for inference.

Its network is read from the checkpoint's tensors and run by numpy: eight states cost less than
any library's overhead. Source: METHOD 2.2 to 2.4; the tensors are data, see ``checkpoint.py``.
"""

from collections.abc import Mapping
from typing import Any, cast, get_args

import numpy as np
from numpy.typing import NDArray

from app.errors import CheckpointMismatch, InvalidInput
from app.policies.checkpoint import (
    REACHING,
    Checkpoint,
    expect_layout,
    require_purpose,
    task_of,
)
from app.policies.reach_preset import action_of
from app.policies.trained_cell import cell_of
from app.sim.actions import ActionSettings
from app.sim.goal_sets import halton_targets
from app.sim.kernels.reach_features import SIZES, STATE_SIZES
from app.sim.ports import Vec
from app.sim.reach import N_ACT, GoalRule, ViewName, goal_region_of

LAYOUTS = {
    "features": [[name, size] for name, size in SIZES],
    "state": [[name, size] for name, size in STATE_SIZES],
}
"""Names and sizes of the groups of each kind of observation, as manifests carry them."""
MAX_LAYERS = 16
"""Most layers of a network taken from a checkpoint."""

Layer = tuple[NDArray[np.float32], NDArray[np.float32]]


def is_reach(checkpoint: Checkpoint) -> bool:
    """Tell whether a checkpoint's policy reaches goals beside people."""
    return task_of(checkpoint) == REACHING


class ReachPolicy:
    """Says how to move toward a goal; safe to call from several threads.

    Args:
        checkpoint: A ``policy`` checkpoint of a reach preset.

    Raises:
        CheckpointMismatch: It is for another task, network or layout.
        InvalidInput: Its preset names an unknown rule.
    """

    def __init__(self, checkpoint: Checkpoint) -> None:
        require_purpose(checkpoint, REACHING)
        manifest = checkpoint.manifest
        preset, cell = manifest["preset"], cell_of(manifest)
        self._checkpoint, self._cell = checkpoint, (cell.name, cell.sha256)
        self.view = cast(ViewName, _named(preset, "observation", get_args(ViewName)))
        """What it sees."""
        expect_layout(checkpoint, LAYOUTS[self.view], N_ACT)
        self.goals = cast(GoalRule, _named(preset, "goals", get_args(GoalRule)))
        """Where the goals of its training were drawn from."""
        self.action: ActionSettings = action_of(preset)
        """What its actions mean (METHOD 2.2)."""
        self.targets: Vec | None = None
        """The goals it was trained on [m], shape (n, 3); None for a whole box."""
        if self.goals == "grid":
            self.targets = goal_region_of(cell).targets()
        if self.goals == "halton":
            self.targets = halton_targets(goal_region_of(cell), _n_halton(preset))
        self.n_obs = sum(size for _, size in manifest["layout"])
        """Length of an observation."""
        self._layers = _layers_of(checkpoint.arrays(), self.n_obs)

    @property
    def checkpoint(self) -> str:
        """SHA-256 of the checkpoint."""
        return self._checkpoint.sha256

    @property
    def title(self) -> str:
        """Short text for people."""
        manifest = self._checkpoint.manifest
        name = manifest["preset"].get("name", "policy")
        return f"{name}, {manifest['step'] / 1e6:.2f} M steps"

    @property
    def cell(self) -> str:
        """Name of the work cell it was trained for."""
        return self._cell[0]

    @property
    def cell_sha256(self) -> str:
        """Identity of that cell's content."""
        return self._cell[1]

    @property
    def trained_range(self) -> Mapping[str, Mapping[str, list[float]]]:
        """Least and greatest value of each state variable met in training."""
        ranges: Mapping[str, Mapping[str, list[float]]] = self._checkpoint.manifest[
            "trained_range"
        ]
        return ranges

    def acts(self, obs: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return actions in [-1, 1], shape (n, 6), of observations, shape (n, n_obs).

        Raises:
            InvalidInput: They have another shape.
        """
        if obs.ndim != 2 or obs.shape[1] != self.n_obs:
            raise InvalidInput(
                "obs", list(obs.shape), f"must have the shape ['n', {self.n_obs}]"
            )
        rows = obs
        for weight, bias in self._layers[:-1]:
            rows = rows @ weight
            rows += bias
            np.maximum(rows, 0.0, out=rows)
        weight, bias = self._layers[-1]
        rows = rows @ weight
        rows += bias
        return cast(NDArray[np.float32], np.tanh(rows, out=rows))


def _named(preset: Mapping[str, Any], field: str, choices: tuple[str, ...]) -> str:
    """Return a choice that a manifest's preset names."""
    value = preset.get(field)
    if value not in choices:
        raise InvalidInput(f"manifest.preset.{field}", value, "must be a known rule", choices)
    return str(value)


def _n_halton(preset: Mapping[str, Any]) -> int:
    """Return the size of the Halton set that a manifest's preset names."""
    value = preset.get("n_halton")
    if not isinstance(value, int):
        raise InvalidInput("manifest.preset.n_halton", value, "must be a whole number")
    return value


def _layers_of(arrays: Mapping[str, NDArray[Any]], n_obs: int) -> tuple[Layer, ...]:
    """Return weights, shape (n_in, n_out), and biases of the actor, layer by layer.

    Raises:
        CheckpointMismatch: Its tensors do not make a network from observations to actions.
    """
    layers: list[Layer] = []
    n_in = n_obs
    for number in range(MAX_LAYERS):
        weight = arrays.get(f"actor.net.{2 * number}.weight")
        bias = arrays.get(f"actor.net.{2 * number}.bias")
        if weight is None or bias is None:
            break
        if weight.ndim != 2 or weight.shape[1] != n_in or bias.shape != weight.shape[:1]:
            found = f"{list(weight.shape)} and {list(bias.shape)}"
            name = f"tensors.actor.net.{2 * number}"
            raise CheckpointMismatch(name, f"[n, {n_in}] and [n]", found)
        n_in = len(bias)
        rows = np.ascontiguousarray(weight.T, dtype=np.float32)
        layers.append((rows, bias.astype(np.float32)))
    if not layers or n_in != N_ACT:
        raise CheckpointMismatch("tensors", f"an actor of {N_ACT} numbers", "none such")
    return tuple(layers)
