"""Checkpoints for tests of what stands around policies: untrained, or trained otherwise.

Who looks ahead with an untrained policy finds a contact at every turn, and tries every other
way: where a test plays episodes so, the shipped policy takes a fraction of the time.
"""

from dataclasses import asdict

import torch

from app.policies.checkpoints import checkpoint as formats
from app.policies.checkpoints import pretrained
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.model_state import weights_of
from app.policies.checkpoints.trained_cell import manifest_fields
from app.policies.configs import presets
from app.policies.configs.reach import ReachPreset
from app.policies.inference.reach_policy import LAYOUTS
from app.policies.training.reach import networks_of
from app.sim.cells.cell import Cell, load_cell
from app.sim.reach.batch import N_ACT


def untrained_reach(seed: int = 0, cell: Cell | None = None, **overrides: object) -> Checkpoint:
    """Return a ``policy`` checkpoint of ``reach-td3`` whose actor is random.

    Args:
        seed: Seed of its weights.
        cell: Work cell; the preset's own by default.
        overrides: Fields of the preset, such as ``goals="box"`` or ``width=32``.
    """
    preset = presets.resolve("reach-td3", overrides)
    assert isinstance(preset, ReachPreset)
    layout = LAYOUTS[preset.observation]
    n_obs = sum(size for _, size in layout)
    generator = torch.random.get_rng_state()
    torch.manual_seed(seed)
    actor = networks_of(preset, n_obs, n_obs).actor()
    with torch.no_grad():
        actor.net[-1].weight.mul_(40.0)
    torch.random.set_rng_state(generator)
    manifest = {
        "format": formats.FORMAT,
        "kind": "policy",
        "preset": asdict(preset),
        "seed": seed,
        **manifest_fields(cell or load_cell(preset.cell)),
        "layout": layout,
        "act_size": N_ACT,
        "width": preset.width,
        "step": 0,
        "updates": 0,
        "trained_range": {},
    }
    return formats.pack(manifest, weights_of({"actor": actor}))


def shipped_as(**fields: object) -> Checkpoint:
    """Return the shipped reach policy as if its preset had other fields, such as ``goals``."""
    shipped = pretrained.load("reach")
    preset = shipped.manifest["preset"] | fields
    return formats.load({**shipped.manifest, "preset": preset}, shipped.tensors)
