"""Networks of the pick scenario, and the layout of their observations."""

from app.policies.configs.td3 import ActorCriticNetworks
from app.policies.networks.actor_critic import Critics, ResidualActor
from app.sim.pick.kernels.observation import BODY_SIZES, SIZES

LAYOUTS = {
    "features": [[name, size] for name, size in SIZES],
    "body": [[name, size] for name, size in BODY_SIZES],
}
"""Names and sizes of the groups of each kind of observation, as manifests carry them."""


def actor_of(sizes: ActorCriticNetworks, n_obs: int) -> ResidualActor:
    """Return a new actor for observations of a length."""
    return ResidualActor(sizes.width, n_obs, layers=sizes.layers)


def critics_for(sizes: ActorCriticNetworks, n_obs: int) -> Critics:
    """Return new critics for observations of a length."""
    normed = sizes.critic_norm == "layer"
    return Critics(
        sizes.width, n_obs, n_critics=sizes.n_critics, layers=sizes.layers, normed=normed
    )
