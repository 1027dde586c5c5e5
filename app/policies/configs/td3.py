"""Groups of fields that the trainings of both TD3 scenarios, pick and reach, share."""

from typing import Literal, Self

from pydantic import model_validator

from app.errors import InvalidInput
from app.policies.checkpoints.checkpoint import MAX_BYTES
from app.policies.configs.fields import FieldGroup, Learning, Whole, choice, number
from app.sim.robot.actions import ActionSettings

MOST_SEEN = 256
"""Upper bound of the inputs of a network, its smaller parts included."""
SPARE_BYTES = 1 << 18
"""Bound of what a checkpoint has beside actor and critics: outcome probabilities, ranges."""


class TD3Learning(Learning):
    """TD3; DDPG is TD3 with one critic, no delay and no target noise."""

    update_every: Whole = number(
        1, 1, 1000, "", "Update interval: steps of all environments per update"
    )
    gradient_steps: Whole = number(
        1, 1, 1000, "updates", "Gradient steps: updates at each update interval"
    )
    actor_lr_ratio: float = number(
        1.0, 0.01, 100.0, "", "Learning rate ratio: the actor's over the critics'"
    )
    tau: float = number(0.005, 1e-4, 1.0, "", "Target update factor τ")
    policy_delay: Whole = number(
        1, 1, 10, "updates", "Policy delay: critic updates per actor update"
    )
    target_noise: float = number(0.1, 0.0, 1.0, "", "Target noise: smooths target actions")
    target_noise_clip: float = number(0.25, 0.0, 1.0, "", "Bound of the target noise")
    actor_frozen_updates: Whole = number(
        1_000, 0, 1_000_000, "updates", "Frozen actor: critic updates before it learns"
    )
    ema: float = number(
        0.0, 0.0, 0.99999, "", "Actor averaging: decay of its weights; 0 keeps no average"
    )


class ActorCriticNetworks(FieldGroup):
    """Sizes of actor and critics."""

    width: Whole = number(256, 16, 1024, "units", "Width of the hidden layers")
    layers: Whole = number(2, 1, 12, "", "Hidden layers")
    critic_norm: Literal["layer", "none"] = choice("layer", "Normalisation of the critics")
    n_critics: Whole = number(2, 1, 10, "", "Critics: value functions")
    n_quantiles: Whole = number(25, 2, 100, "", "Quantiles per critic")
    dropped_quantiles: Whole = number(
        2, 0, 99, "", "Dropped quantiles: the highest ones per critic, left out in targets"
    )

    @property
    def n_bytes(self) -> int:
        """Upper bound of the size of actor and critics [bytes]."""
        per_network = self.width * ((self.layers - 1) * self.width + MOST_SEEN)
        values = self.n_critics * self.n_quantiles * self.width
        return 4 * ((1 + self.n_critics) * per_network + values)

    @model_validator(mode="after")
    def _check_sizes(self) -> Self:
        """Check that targets keep quantiles, and that the networks fit into a checkpoint."""
        if self.dropped_quantiles >= self.n_quantiles:
            rule = f"must be below n_quantiles = {self.n_quantiles}"
            raise InvalidInput("networks.dropped_quantiles", self.dropped_quantiles, rule)
        if (size := self.n_bytes) + SPARE_BYTES > MAX_BYTES:
            rule = (
                f"makes networks of {size / 2**20:.0f} MB with layers = {self.layers} and "
                f"n_critics = {self.n_critics}; must stay below {MAX_BYTES // 2**20} MB"
            )
            raise InvalidInput("networks.width", self.width, rule)
        return self


class NoiseExploration(FieldGroup):
    """AR(1) noise whose scale differs between the environments."""

    sigma_max: float = number(0.5, 0.0, 2.0, "", "Largest noise scale σ")
    noise_time_s: float = number(0.2, 0.05, 5.0, "s", "Correlation time of the noise")
    greedy_share: float = number(
        0.05, 0.0, 1.0, "", "Greedy share: environments without noise, at least one"
    )

    def n_greedy(self, n_envs: int) -> int:
        """Return the number of environments without noise."""
        return max(1, round(self.greedy_share * n_envs))

    def check_noise(self, n_envs: int) -> None:
        """Check that some environments explore with AR(1) noise.

        Raises:
            InvalidInput: All are greedy.
        """
        if self.n_greedy(n_envs) >= n_envs:
            rule = f"must leave environments with noise, of n_envs = {n_envs}"
            raise InvalidInput("exploration.greedy_share", self.greedy_share, rule)


class ActionConfig(FieldGroup):
    """Meaning of an action; see :class:`~app.sim.robot.actions.ActionSettings`."""

    degree: Whole = number(
        2, 2, 3, "", "Degree of a segment: 2 limits acceleration, 3 also jerk"
    )
    bounds: Literal["viable", "one-step"] = choice(
        "viable", "Bounds: viable ones keep every limit; one-step are the thesis' (degree 2)"
    )
    meaning: Literal["speed", "coefficient"] = choice(
        "speed", "Meaning: a joint speed, or a place in the interval of the coefficient"
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Check the bounds against the degree."""
        if self.degree == 3 and self.bounds != "viable":
            rule = "must be viable with degree = 3"
            raise InvalidInput("action.bounds", self.bounds, rule)
        return self

    @property
    def settings(self) -> ActionSettings:
        """The same for the scenarios."""
        return ActionSettings(degree=self.degree, bounds=self.bounds, meaning=self.meaning)
