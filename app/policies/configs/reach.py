"""The presets of the reach scenario: every number of their training, frozen and named."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, get_args

from app.errors import InvalidInput
from app.policies.configs.fields import check_learning, check_rounds, choice, number
from app.sim.reach.batch import GoalRule, StartRule, ViewName
from app.sim.reach.goal_sets import MOST_HALTON, N_HALTON
from app.sim.robot.actions import BOUNDS, MEANINGS, ActionSettings

ACTORS = ("residual", "plain")
CRITICS = ("mean", "quantiles")
SIGHTS = ("observation", "future")
PRECISIONS = ("float32", "bfloat16")
SAFETIES = ("none", "ssm")
MAX_BYTES = 16 * 1024 * 1024
"""Size of the networks that a checkpoint holds [bytes]."""
MOST_SEEN = 256
"""Most numbers that a network sees, its smaller parts included."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachPreset:
    """TD3 or DDPG on the reach scenario: all that a training depends on besides its seed.

    The defaults are those of ``reach-td3``. Source: METHOD 2.2, 2.3 and 2.5 for the form.
    Deviates: table 4.2's values; these are the ones that learn in minutes (batched cells, speed
    targets, features, reward for progress). The source's recipe is ``reach-ddpg-thesis``.
    """

    name: str = "reach-td3"
    """Name in requests."""
    cell: str = "shared-workspace"
    """Work cell trained in."""

    total_steps: int = number(
        7_680_000, 1_000, 100_000_000, "env steps", "length of the training"
    )
    n_envs: int = number(128, 1, 1024, "", "cells stepped together")
    buffer_size: int = number(
        400_000, 2_000, 2_000_000, "transitions", "size of the replay memory"
    )
    batch_size: int = number(256, 16, 4096, "transitions", "minibatch of an update")
    learning_starts: int = number(
        25_600, 0, 1_000_000, "env steps", "steps before the first update"
    )
    update_every: int = number(1, 1, 1000, "", "steps of all cells per update")
    lr_start: float = number(5e-4, 1e-6, 1e-2, "", "learning rate at the start")
    lr_end: float = number(2e-5, 1e-7, 1e-2, "", "learning rate at the end")
    actor_lr_ratio: float = number(1.0, 0.01, 100.0, "", "actor's learning rate over critics'")
    gamma: float = number(0.99, 0.5, 0.9999, "per step", "discount")
    n_steps: int = number(5, 1, 20, "steps", "length of n-step returns")
    tau: float = number(0.005, 1e-4, 1.0, "", "target update factor")
    policy_delay: int = number(1, 1, 10, "updates", "critic updates per actor update")
    target_noise: float = number(0.1, 0.0, 1.0, "", "smoothing noise on target actions")
    target_noise_clip: float = number(0.25, 0.0, 1.0, "", "bound of the smoothing noise")
    actor_frozen_updates: int = number(
        1_000, 0, 1_000_000, "updates", "critic updates before the actor learns"
    )
    width: int = number(256, 16, 1024, "units", "width of the hidden layers")
    layers: int = number(2, 1, 12, "", "hidden layers")
    actor: str = choice(
        "residual", ACTORS, "acts on top of the straight way to the goal, or on its own"
    )
    critic_norm: str = choice("layer", ("layer", "none"), "normalisation in the critics")
    n_critics: int = number(2, 1, 10, "", "critics; the least value counts")
    critic: str = choice(
        "mean",
        CRITICS,
        "what critics say: the mean return, or quantiles, cut in targets",
    )
    n_quantiles: int = number(25, 2, 100, "", "quantiles per critic, for critic = quantiles")
    dropped_quantiles: int = number(
        2, 0, 99, "", "highest quantiles per critic that targets leave out"
    )
    critic_sees: str = choice(
        "observation", SIGHTS, "what critics see: as the actor, or also where people will be"
    )
    ema: float = number(
        0.999,
        0.0,
        0.99999,
        "",
        "what an update leaves of the averaged actor; 0: no average",
    )
    precision: str = choice(
        "float32", PRECISIONS, "products in training; bfloat16 is faster on some processors"
    )
    alpha: float = number(0.0, 0.0, 1.0, "", "exponent of replay priorities; 0 draws evenly")
    beta: float = number(0.4, 0.0, 1.0, "", "exponent of importance weights at the start")

    noise: str = choice(
        "ladder", ("ladder", "ou"), "AR(1), stronger row by row, or Ornstein-Uhlenbeck"
    )
    sigma_max: float = number(0.6, 0.0, 2.0, "", "strongest exploration noise")
    noise_time_s: float = number(0.2, 0.05, 5.0, "s", "correlation time of ladder noise")
    greedy_share: float = number(
        0.05, 0.0, 1.0, "", "share of cells without ladder noise; at least one"
    )
    option_rate: float = number(
        0.0, 0.0, 0.5, "per step", "how often a random option starts in half the cells"
    )
    ou_theta: float = number(0.3, 0.0, 1.0, "per step", "pull of Ornstein-Uhlenbeck noise")
    ou_sigma: float = number(0.15, 0.0, 2.0, "", "push of Ornstein-Uhlenbeck noise")

    time_limit_s: float = number(5.0, 1.0, 60.0, "s", "longest episode")
    goals: str = choice("grid", get_args(GoalRule), "where goals are drawn from")
    n_halton: int = number(
        N_HALTON, 8, MOST_HALTON, "", "points of the Halton set, for goals = halton"
    )
    start: str = choice("clearance", get_args(StartRule), "where people may start")
    start_clearance_m: float = number(
        0.05, 0.0, 1.0, "m", "least distance of robot and person at the start"
    )
    n_people: int = number(1, 0, 4, "", "people who walk; the policy sees the nearest")
    people: str = choice(
        "all",
        ("all", "up-to"),
        "all cells have n_people, or equal shares of them 1, 2, ... n_people",
    )
    safety: str = choice(
        "none",
        SAFETIES,
        "what scales the motion: nothing, or speed and separation monitoring as in the cell",
    )
    collision: str = choice(
        "ends", ("ends", "goes-on"), "whether a collision ends an episode or it goes on"
    )
    observation: str = choice(
        "forecast",
        get_args(ViewName),
        "what the networks see: the plain state, features, or what is forecast with them",
    )

    action_degree: int = number(
        2, 2, 3, "", "degree of the motion in a period: 2 limits acceleration, 3 also jerk"
    )
    action_bounds: str = choice(
        "viable", BOUNDS, "viable never exceeds a limit; one-step is the source's (degree 2)"
    )
    action_meaning: str = choice(
        "speed", MEANINGS, "what an action is: a wanted joint speed or a place in the interval"
    )

    c_d: float = number(0.0, 0.0, 10.0, "1/m", "cost of the distance to the goal")
    c_p: float = number(1.0, 0.0, 10.0, "1/m", "reward for progress toward the goal")
    c_a: float = number(0.0, 0.0, 10.0, "s^2/rad", "cost of accelerating")
    c_step: float = number(0.003, 0.0, 1.0, "", "cost of a control period")
    c_c: float = number(4.0, 0.0, 100.0, "", "cost of a collision")
    c_s: float = number(4.0, 0.0, 100.0, "", "bonus of a success")
    c_o: float = number(
        0.0, 0.0, 10.0, "", "cost of a period that monitoring stops, for safety = ssm"
    )

    progress_steps: int = number(
        256_000, 100, 1_000_000, "env steps", "steps between two points of the curve"
    )
    progress_episodes: int = number(
        1_080, 1, 10_000, "episodes", "episodes played for a point of the curve"
    )
    checkpoint_steps: int = number(
        1_280_000, 100, 10_000_000, "env steps", "steps between two checkpoints"
    )

    @property
    def action(self) -> ActionSettings:
        """How the scenario reads actions."""
        return ActionSettings(
            degree=self.action_degree, bounds=self.action_bounds, meaning=self.action_meaning
        )

    def check(self) -> None:
        """Check the fields against each other.

        Raises:
            InvalidInput: Two of them do not go together.
        """
        check_rounds(self.total_steps, self.progress_steps, self.checkpoint_steps, self.n_envs)
        if self.action_degree == 3 and self.action_bounds != "viable":
            raise InvalidInput(
                "overrides.action_bounds",
                self.action_bounds,
                "must be viable with action_degree = 3",
            )
        if self.actor == "residual" and self.observation == "state":
            raise InvalidInput(
                "overrides.actor", self.actor, "must be plain with observation = state"
            )
        if self.dropped_quantiles >= self.n_quantiles:
            raise InvalidInput(
                "overrides.dropped_quantiles",
                self.dropped_quantiles,
                f"must be below n_quantiles = {self.n_quantiles}",
            )
        if self.observation == "state" and self.critic_sees == "future":
            raise InvalidInput(
                "overrides.critic_sees",
                self.critic_sees,
                "must be observation with observation = state: its time-outs are no true ends",
            )
        if self.safety == "ssm" and (self.collision != "ends" or self.n_people == 0):
            raise InvalidInput(
                "overrides.safety",
                self.safety,
                "needs somebody to watch, n_people above 0, and collision = ends",
            )
        if self.people == "up-to" and (
            self.n_people == 0
            or self.n_envs < self.n_people
            or self.safety != "none"
            or self.critic_sees != "observation"
            or self.option_rate > 0.0
        ):
            raise InvalidInput(
                "overrides.people",
                self.people,
                "needs 1 to n_envs people, safety = none, critic_sees = observation and "
                "option_rate = 0",
            )
        _check_size(self)
        check_learning(self.learning_starts, self.total_steps, self.buffer_size, self.n_envs)


def _check_size(preset: ReachPreset) -> None:
    """Check that the networks fit into a checkpoint.

    Raises:
        InvalidInput: They are too large.
    """
    per_network = preset.width * ((preset.layers - 1) * preset.width + MOST_SEEN)
    size = 4 * (1 + preset.n_critics) * per_network
    if size > MAX_BYTES:
        raise InvalidInput(
            "overrides.width",
            preset.width,
            f"makes networks of {size / 2**20:.0f} MB with layers = {preset.layers} and "
            f"n_critics = {preset.n_critics}; must stay below {MAX_BYTES // 2**20} MB",
        )


THESIS = ReachPreset(
    name="reach-ddpg-thesis",
    total_steps=4_000_000,
    n_envs=1,
    buffer_size=200_000,
    batch_size=128,
    learning_starts=1_000,
    update_every=60,
    lr_start=1e-4,
    lr_end=1e-4,
    actor_lr_ratio=10.0,
    gamma=0.99,
    n_steps=1,
    tau=0.001,
    policy_delay=1,
    target_noise=0.0,
    target_noise_clip=0.0,
    actor_frozen_updates=0,
    width=400,
    layers=10,
    actor="plain",
    ema=0.0,
    critic_norm="none",
    n_critics=1,
    alpha=0.6,
    noise="ou",
    collision="goes-on",
    observation="state",
    action_bounds="one-step",
    action_meaning="coefficient",
    c_d=1.0,
    c_p=0.0,
    c_a=0.1,
    c_step=0.0,
    c_c=5.0,
    c_s=20.0,
    progress_steps=50_000,
    progress_episodes=1_080,
    checkpoint_steps=500_000,
)
"""Thesis table 4.2 as printed: DDPG, prioritised replay, Ornstein-Uhlenbeck noise. What is not
printed: the exponents of the priorities are those of Schaul et al. (2016), the process moves by
one unit of time per period, an episode goes on after a collision as in the authors' code."""

MONITORED = ReachPreset(
    name="reach-td3-monitored",
    safety="ssm",
    time_limit_s=10.0,
    start_clearance_m=0.8,
    c_o=0.02,
)
"""Ours under speed and separation monitoring: it learns where people who come will stop it, and
has twice the time. Everybody starts so far away that the robot may set out."""

CROWD = ReachPreset(
    name="reach-td3-crowd",
    n_people=4,
    people="up-to",
    observation="crowd",
)
"""Ours beside one to four people, whom the networks see as a set."""

REACH_PRESETS = (ReachPreset(), MONITORED, CROWD, THESIS)
"""All presets of the scenario."""


def action_of(preset: Mapping[str, Any]) -> ActionSettings:
    """Return what actions mean to a checkpoint, from the preset in its manifest.

    Raises:
        InvalidInput: It names an unknown choice.
    """
    return ActionSettings(
        degree=preset.get("action_degree", 2),
        bounds=preset.get("action_bounds", "viable"),
        meaning=preset.get("action_meaning", "speed"),
    )
