"""The preset of the pick scenario: every number of its training, frozen and named."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from app.errors import InvalidInput, digits
from app.policies.configs.fields import check_learning, check_rounds, choice, number
from app.sim.robot.actions import BOUNDS, MEANINGS, ActionSettings

HUMAN_MOTIONS = ("library", "reaches")
AUGMENTATIONS = ("sampled", "replayed")
OBSERVATIONS = ("features", "body")


@dataclass(frozen=True, slots=True, kw_only=True)
class PickPreset:
    """TD3 on the pick scenario: all that a training run depends on besides its seed.

    The defaults are those of ``pick-td3``. Source: METHOD 3.3 and 3.5 for the form.
    Deviates: the values of table 5.2 are replaced by values that learn in minutes (residual
    action, features, n-step returns, batched cells). No preset has the source's values.
    """

    name: str = "pick-td3"
    """Name in requests."""
    cell: str = "pick-and-place"
    """Work cell trained in."""

    total_steps: int = number(
        4_608_000, 1_000, 100_000_000, "env steps", "length of the training"
    )
    n_envs: int = number(128, 8, 1024, "", "cells stepped together")
    buffer_size: int = number(
        400_000, 2_000, 2_000_000, "transitions", "size of the replay memory"
    )
    batch_size: int = number(512, 16, 4096, "transitions", "minibatch of an update")
    learning_starts: int = number(
        25_600, 0, 1_000_000, "env steps", "steps before the first update"
    )
    lr_start: float = number(5e-4, 1e-6, 1e-2, "", "learning rate at the start")
    lr_end: float = number(3e-5, 1e-7, 1e-2, "", "learning rate at the end")
    gamma: float = number(0.993, 0.5, 0.9999, "per step", "discount")
    n_steps: int = number(5, 1, 20, "steps", "length of n-step returns")
    tau: float = number(0.005, 1e-4, 1.0, "", "target update factor")
    policy_delay: int = number(2, 1, 10, "updates", "critic updates per actor update")
    target_noise: float = number(0.1, 0.0, 1.0, "", "smoothing noise on target actions")
    target_noise_clip: float = number(0.25, 0.0, 1.0, "", "bound of the smoothing noise")
    actor_frozen_updates: int = number(
        3_000, 0, 1_000_000, "updates", "critic updates before the actor learns"
    )
    width: int = number(256, 16, 1024, "units", "width of the hidden layers")

    sigma_max: float = number(0.5, 0.0, 2.0, "", "strongest exploration noise")
    noise_time_s: float = number(0.2, 0.05, 5.0, "s", "correlation time of the noise")
    greedy_share: float = number(
        0.125, 0.01, 1.0, "", "share of cells without exploration; the curve is theirs"
    )
    option_rate: float = number(
        0.02, 0.0, 0.5, "per step", "how often a random option starts in half the cells"
    )

    time_limit_s: float = number(20.0, 1.0, 60.0, "s", "longest episode")
    short_limit_s: float = number(10.0, 1.0, 60.0, "s", "time left in short episodes")
    short_share: float = number(0.5, 0.0, 1.0, "", "share of short episodes")
    start_clearance_m: float = number(
        0.05, 0.0, 0.5, "m", "least distance of robot and person at the start"
    )
    target_jitter_m: float = number(
        0.04, 0.0, 0.2, "m", "half width of the box around a station for targets"
    )
    way_share: float = number(0.15, 0.0, 1.0, "", "episodes that start on the way")
    human_motion: str = choice(
        "library", HUMAN_MOTIONS, "what the person does: task primitives or the first reaches"
    )
    augmentation: str = choice(
        "sampled", AUGMENTATIONS, "primitives sampled and varied, or demonstrations replayed"
    )
    n_people: int = number(2, 1, 4, "", "people in a cell; the policy sees the nearest")
    human_absent: float = number(
        0.35, 0.0, 1.0, "", "share of people who are not there in an episode"
    )
    human_roaming: float = number(
        0.2, 0.0, 1.0, "", "share of people who do anything but the task"
    )
    human_pace: float = number(1.0, 0.2, 2.0, "", "speed of the person, 1 = as cycled")
    human_courtesy: float = number(
        0.0, 0.0, 1.0, "", "how far the person gives way to the arm; 0 does not see it"
    )
    observation: str = choice(
        "features", OBSERVATIONS, "what the networks see: features, or the body's size too"
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

    c_d: float = number(1.0, 0.0, 10.0, "1/m", "reward for progress toward the target")
    c_th: float = number(0.25, 0.0, 10.0, "1/rad", "reward for an upright tool")
    c_c: float = number(5.0, 0.0, 100.0, "", "cost of a collision")
    c_step: float = number(0.005, 0.0, 1.0, "", "cost of a control period")
    c_v: float = number(0.0, 0.0, 10.0, "s/m", "cost of tcp speed near the target")
    d_v: float = number(0.1, 0.0, 1.0, "m", "distance within which tcp speed costs")
    c_s: float = number(4.0, 0.0, 100.0, "", "bonus of a success")

    progress_steps: int = number(
        51_200, 128, 1_000_000, "env steps", "steps between two points of the curve"
    )
    checkpoint_steps: int = number(
        512_000, 128, 10_000_000, "env steps", "steps between two checkpoints"
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
        check_learning(self.learning_starts, self.total_steps, self.buffer_size, self.n_envs)
        if self.short_limit_s > self.time_limit_s:
            raise InvalidInput(
                "overrides.short_limit_s",
                self.short_limit_s,
                f"must not exceed time_limit_s = {digits(self.time_limit_s)} s",
            )


def action_of(preset: Mapping[str, Any]) -> ActionSettings:
    """Return what actions mean to a checkpoint, from the preset in its manifest."""
    known = ActionSettings()
    return ActionSettings(
        degree=preset.get("action_degree", known.degree),
        bounds=preset.get("action_bounds", known.bounds),
        meaning=preset.get("action_meaning", known.meaning),
    )
