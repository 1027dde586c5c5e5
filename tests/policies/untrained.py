"""Checkpoints for tests of the code around policies: untrained, or with other manifests.

Rollouts of an untrained policy end in collisions, so that every candidate is simulated; tests
of episodes with rollouts take a fraction of the time with the shipped policy.
"""

import numpy as np
import torch
from numpy.typing import NDArray

from app.policies.checkpoints import checkpoint as formats
from app.policies.checkpoints import pretrained
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.model_state import weights_of
from app.policies.checkpoints.trained_cell import manifest_fields
from app.policies.configs import presets
from app.policies.configs.fields import entries
from app.policies.configs.reach import ReachPreset
from app.policies.inference.reach_policy import LAYOUTS
from app.policies.training.reach import networks_of
from app.sim.cells.cell import Cell, load_cell
from app.sim.reach.batch import N_ACT


def reach_preset(**overrides: object) -> ReachPreset:
    """Return ``reach-td3`` with fields changed; they go by their own names, without groups."""
    paths = {one.path.split(".")[1]: one.path for one in entries(presets.get("reach-td3"))}
    changed = {paths[name]: value for name, value in overrides.items()}
    preset = presets.resolve("reach-td3", presets.nested(changed))
    assert isinstance(preset, ReachPreset)
    return preset


def untrained_reach(seed: int = 0, cell: Cell | None = None, **overrides: object) -> Checkpoint:
    """Return a ``policy`` checkpoint of ``reach-td3`` whose actor is random.

    Args:
        seed: Seed of its weights.
        cell: Work cell; the preset's own by default.
        overrides: Fields of the preset by their own names, such as ``width=32``.
    """
    preset = reach_preset(**overrides)
    layout = LAYOUTS[preset.episode.observation]
    n_obs = sum(size for _, size in layout)
    generator = torch.random.get_rng_state()
    torch.manual_seed(seed)
    actor = networks_of(preset, n_obs).actor()
    with torch.no_grad():
        actor.net[-1].weight.mul_(40.0)
    torch.random.set_rng_state(generator)
    manifest = {
        "format": formats.FORMAT,
        "kind": "policy",
        "preset": preset.model_dump(),
        "seed": seed,
        **manifest_fields(cell or load_cell(preset.cell)),
        "layout": layout,
        "act_size": N_ACT,
        "width": preset.networks.width,
        "step": 0,
        "updates": 0,
        "trained_range": {},
    }
    return formats.pack(manifest, weights_of({"actor": actor}))


def shipped_as(**fields: object) -> Checkpoint:
    """Return the shipped reach policy as if its episodes had other ``fields``."""
    shipped = pretrained.load("reach")
    preset = shipped.manifest["preset"]
    preset = {**preset, "episode": preset["episode"] | fields}
    return formats.load({**shipped.manifest, "preset": preset}, shipped.tensors)


def shipped_pick_of(*stations: str) -> Checkpoint:
    """Return the shipped pick policy as if its cell had only these stations."""
    shipped, cell = pretrained.load("pick"), load_cell("pick-and-place")
    kept = tuple(cell.station(name) for name in stations)
    fewer = cell.model_copy(update={"name": "fewer-stations", "stations": kept})
    return formats.load({**shipped.manifest, **manifest_fields(fewer)}, shipped.tensors)


def overflowing_reach() -> Checkpoint:
    """Return a reach policy whose actions are NaN, although its weights are finite."""
    whole = untrained_reach(width=16)
    arrays = {name: array.copy() for name, array in whole.arrays().items()}
    arrays["actor.net.0.weight"][:], arrays["actor.net.0.bias"][:] = 0.0, 10.0
    arrays["actor.net.2.weight"][:] = 3e38
    arrays["actor.net.4.weight"][:, ::2], arrays["actor.net.4.weight"][:, 1::2] = 1.0, -1.0
    return formats.pack(whole.manifest, arrays)


def overflowing(alias: str, part: str = "") -> Checkpoint:
    """Return a shipped policy with weights so large that sums overflow, although finite.

    Args:
        part: Start of the names of its changed tensors.
    """
    shipped = pretrained.load(alias)

    def changed(name: str, array: NDArray[np.float32]) -> NDArray[np.float32]:
        is_weight = name.startswith(part) and name.endswith("weight")
        return np.copysign(np.float32(3e38), array) if is_weight else array

    arrays = {name: changed(name, array) for name, array in shipped.arrays().items()}
    return formats.pack(shipped.manifest, arrays)
