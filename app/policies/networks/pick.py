"""Networks of the pick scenario, and the layout of their observations."""

from app.policies.configs.pick import PickPreset
from app.policies.networks.actor_critic import (
    Critics,
    MeanCritics,
    PlainActor,
    QNetwork,
    ResidualActor,
    ResidualFading,
    initialise_glorot,
)
from app.policies.networks.quantiles import QuantileCritics
from app.sim.pick.kernels.observation_layout import (
    BODY_SIZES,
    DISTANCE_SCALE,
    LAYOUT,
    PHASE_SIZES,
    PICK_SIZES,
    SIZES,
)
from app.sim.robot.kernels.arm import CONTROLLED

RESIDUAL_FULL_M, RESIDUAL_ZERO_M = 0.4, 0.5
"""Distances to people below which the residual counts fully, and beyond which the base motion
acts alone [m]."""
CLEARANCE = LAYOUT["distance_tilt_clearance_time"].start + 2
"""Index of the distance to the nearest person in an observation."""
STATE_SIZES = (("q", 6), ("qd", 6), ("human_q", 18), ("human_qd", 18), ("goal", 3))
"""Names and sizes of the groups of the raw state (5.8)."""
LAYOUTS = {
    "state": [[name, size] for name, size in STATE_SIZES],
    "features": [[name, size] for name, size in SIZES],
    "body": [[name, size] for name, size in BODY_SIZES],
    "phase": [[name, size] for name, size in PHASE_SIZES],
    "two-people": [[name, size] for name, size in PICK_SIZES],
}
"""Names and sizes of the groups of each kind of observation, as manifests carry them."""


def actor_of(preset: PickPreset, n_obs: int) -> ResidualActor | PlainActor:
    """Return a new actor for observations of a length.

    Hidden layers of plain actors are normalised, so that perturbations of their weights have
    similar effects in all layers (Plappert et al. 2018).
    """
    sizes, fade = preset.networks, None
    if sizes.actor == "plain":
        actor = PlainActor(sizes.width, n_obs, CONTROLLED, sizes.layers, normed=True)
        initialise_glorot(actor)
        return actor
    if preset.episode.task == "pick":
        fade = ResidualFading(
            CLEARANCE, RESIDUAL_FULL_M / DISTANCE_SCALE, RESIDUAL_ZERO_M / DISTANCE_SCALE
        )
    return ResidualActor(sizes.width, n_obs, layers=sizes.layers, fade=fade)


def critics_for(preset: PickPreset, n_obs: int) -> Critics:
    """Return new critics for observations of a length."""
    sizes = preset.networks
    shape = sizes.width, n_obs, CONTROLLED, sizes.layers, sizes.critic_norm == "layer"
    quantiles = sizes.critic == "quantiles"
    n_values = sizes.n_quantiles if quantiles else 1
    networks = [QNetwork(*shape, n_values) for _ in range(sizes.n_critics)]
    critics: Critics
    if quantiles:
        critics = QuantileCritics(*networks, dropped=sizes.dropped_quantiles)
    else:
        critics = (MeanCritics if sizes.target_value == "mean" else Critics)(*networks)
    if sizes.actor == "plain":
        initialise_glorot(critics)
    return critics
