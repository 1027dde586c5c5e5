"""State of a training, from which it continues with the same result.

Networks, optimisers, environments, exploration, counters, random generators and the window of
the learning curve are tensors (safetensors) and JSON values; transitions of the replay memory
are in files that the manifest lists (``memory_files.py``).
"""

import json
import random
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from app.errors import CheckpointMismatch, InvalidInput
from app.policies.algorithms.prioritized_replay import PrioritisedReplay
from app.policies.checkpoints.checkpoint import (
    MAX_STATE_BYTES,
    TensorFile,
    check_file,
    tensor_bytes,
)
from app.policies.checkpoints.model_state import tensors_under, weights_of
from app.policies.checkpoints.trained_cell import DEFINITION, manifest_fields
from app.policies.configs.fields import read_config
from app.policies.configs.presets import Preset
from app.sim.cells.cell import Cell
from app.state_dict import State, Stateful

FORMAT = "tandem-training-state/1"
REQUIRED = {
    "format": str,
    "preset": dict,
    "seed": int,
    "cell": str,
    "step": int,
    "cpu_s": float,
    "commits": list,
    "versions": dict,
    "values": dict,
    "memory": list,
}
"""Fields every manifest has, with their JSON types."""
RENAMED = {
    "_sight": "_observation_work",
    "clearances": "clearances_ahead",
    "columns": "capsules",
    "columns0": "capsules0",
    "columns1": "capsules1",
    "gap": "clearance",
    "gap_vector": "to_person",
    "rows": "envs",
    "seen_columns": "seen_capsules",
}
"""Parts of names of environments' arrays in states of earlier versions, and their present
names; ``rows`` of pedestrians keep their name."""


@dataclass(frozen=True)
class TrainingState(TensorFile):
    """Configuration, values that are no arrays, and the files of the replay memory; tensors."""

    @property
    def step(self) -> int:
        """Environment steps so far."""
        return int(self.manifest["step"])

    def entries(self) -> State:
        """Return arrays and values by their present names.

        Raises:
            InvalidInput: The bytes are no safetensors file.
        """
        stored = {**self.arrays(), **self.manifest["values"]}
        return {present_name(name): value for name, value in stored.items()}


def present_name(name: str) -> str:
    """Return the present name of an entry of a state that an earlier version has written."""
    if not name.startswith("env."):
        return name
    start, *rest = name.split(".walkers.", 1)
    parts = [RENAMED.get(part, part) for part in start.split(".")]
    return ".walkers.".join([".".join(parts), *rest])


def pack(manifest: Mapping[str, Any], entries: State) -> TrainingState:
    """Return a checked state; ``entries`` are arrays and JSON values by name."""
    arrays = {name: value for name, value in entries.items() if isinstance(value, np.ndarray)}
    values = {name: value for name, value in entries.items() if name not in arrays}
    return load({**manifest, "format": FORMAT, "values": values}, tensor_bytes(arrays))


def load(manifest: object, tensors: bytes) -> TrainingState:
    """Return a state from stored data.

    Raises:
        InvalidInput: A field is missing or of a wrong type, or the tensors are too large.
        CheckpointMismatch: The format is another one.
    """
    return TrainingState(
        check_file(manifest, tensors, FORMAT, REQUIRED, MAX_STATE_BYTES), bytes(tensors)
    )


def origin(preset: Preset, seed: int, cell: Cell) -> dict[str, Any]:
    """Return the manifest fields that determine a training."""
    fields = {"preset": preset.model_dump(), "seed": seed, **manifest_fields(cell)}
    return dict(json.loads(json.dumps(fields)))


def require_origin(state: TrainingState, preset: Preset, seed: int, cell: Cell) -> None:
    """Check that a state belongs to a training.

    Fields that were added since the state was written had their defaults.

    Raises:
        CheckpointMismatch: A field of the configuration, the seed or the cell differs.
    """
    names = ("preset", "seed", "cell", DEFINITION)
    wanted = dict(_leaves(origin(preset, seed, cell)))
    stored = {name: state.manifest.get(name) for name in names}
    found = dict(_leaves({**stored, "preset": _completed(stored["preset"], type(preset))}))
    for name in sorted({*wanted, *found}):
        if wanted.get(name) != found.get(name):
            raise CheckpointMismatch(
                name.removeprefix("preset."), wanted.get(name), found.get(name)
            )


def _completed(stored: object, kind: type[Preset]) -> object:
    """Return a stored configuration with all fields of its kind; unchanged if it is invalid."""
    try:
        return read_config(kind, stored, "preset").model_dump(mode="json")
    except InvalidInput:
        return stored


def _leaves(tree: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in tree.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{path}{name}.")
        else:
            yield f"{path}{name}", value


class NetworkState(Stateful):
    """Networks and optimisers as a part of a state."""

    def __init__(
        self,
        modules: Mapping[str, torch.nn.Module],
        optimizers: Mapping[str, torch.optim.Optimizer],
    ) -> None:
        self._modules, self._optimizers = modules, optimizers

    def state_dict(self) -> State:
        """Return weights, and moments as ``optimizer.index.moment``."""
        moments = {
            f"{name}.{index}.{key}": tensor.numpy()
            for name, optimizer in self._optimizers.items()
            for index, tensors in optimizer.state_dict()["state"].items()
            for key, tensor in tensors.items()
        }
        return {**weights_of(self._modules), **moments}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore weights and moments."""
        for name, module in self._modules.items():
            module.load_state_dict(tensors_under(state, name))
        for name, optimizer in self._optimizers.items():
            moments: dict[int, dict[str, torch.Tensor]] = {}
            for key, tensor in tensors_under(state, name).items():
                index, moment = key.split(".", 1)
                moments.setdefault(int(index), {})[moment] = tensor.clone()
            optimizer.load_state_dict({**optimizer.state_dict(), "state": moments})


class Priorities(Stateful):
    """Priorities and random generator of a replay memory as a part of a state."""

    def __init__(self, memory: PrioritisedReplay) -> None:
        self._memory = memory

    def state_dict(self) -> State:
        """Return the sum tree, the greatest priority and the generator."""
        memory = self._memory
        arrays = {"tree": memory._tree.copy(), "rng": memory._rng.copy()}
        return {**arrays, "greatest": memory._greatest}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore them."""
        self._memory._tree[:], self._memory._rng[:] = state["tree"], state["rng"]
        self._memory._greatest = state["greatest"]


class GlobalGenerators(Stateful):
    """Global random generators as a part of a state; Stable-Baselines3 uses them all."""

    def state_dict(self) -> State:
        """Return the states of the generators."""
        name, key, *rest = np.random.get_state(legacy=True)  # noqa: NPY002
        version, internal, gauss = random.getstate()
        return {
            "torch": torch.get_rng_state().numpy(),
            "numpy": np.asarray(key),
            "numpy_rest": [name, *rest],
            "python": [version, list(internal), gauss],
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore the generators."""
        name, *rest = state["numpy_rest"]
        np.random.set_state((name, state["numpy"], *rest))  # noqa: NPY002
        version, internal, gauss = state["python"]
        random.setstate((version, tuple(internal), gauss))
        torch.set_rng_state(torch.as_tensor(state["torch"].copy()))
