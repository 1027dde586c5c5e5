"""Networks of the pick scenario, and the layout of their observations."""

from app.policies.configs.pick import PickPreset
from app.policies.networks.actor_critic import Critics, Fade, MeanCritics, ResidualActor
from app.sim.pick.kernels.observation_layout import (
    BODY_SIZES,
    DISTANCE_SCALE,
    LAYOUT,
    PHASE_SIZES,
    PICK_SIZES,
    SIZES,
)

RESIDUAL_FULL_M, RESIDUAL_ZERO_M = 0.4, 0.5
"""Distances to people below which the residual counts fully, and beyond which the base motion
acts alone [m]."""
CLEARANCE = LAYOUT["distance_tilt_clearance_time"].start + 2
"""Index of the distance to the nearest person in an observation."""
LAYOUTS = {
    "features": [[name, size] for name, size in SIZES],
    "body": [[name, size] for name, size in BODY_SIZES],
    "phase": [[name, size] for name, size in PHASE_SIZES],
    "two-people": [[name, size] for name, size in PICK_SIZES],
}
"""Names and sizes of the groups of each kind of observation, as manifests carry them."""


def actor_of(preset: PickPreset, n_obs: int) -> ResidualActor:
    """Return a new actor for observations of a length."""
    sizes, fade = preset.networks, None
    if preset.episode.task == "pick":
        fade = Fade(
            CLEARANCE, RESIDUAL_FULL_M / DISTANCE_SCALE, RESIDUAL_ZERO_M / DISTANCE_SCALE
        )
    return ResidualActor(sizes.width, n_obs, layers=sizes.layers, fade=fade)


def critics_for(preset: PickPreset, n_obs: int) -> Critics:
    """Return new critics for observations of a length."""
    sizes = preset.networks
    kind = MeanCritics if sizes.target_value == "mean" else Critics
    normed = sizes.critic_norm == "layer"
    return kind(
        sizes.width, n_obs, n_critics=sizes.n_critics, layers=sizes.layers, normed=normed
    )
