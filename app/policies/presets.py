"""Presets: every number of an experiment, frozen and named (STYLE 3.5).

A training job names a preset, a seed and overrides. Overrides are checked here, field by field;
this module imports no learning library, so that the service can check and describe presets
cheaply.
"""

import dataclasses
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from app.errors import InvalidInput, NotFound
from app.sim.actions import BOUNDS, MEANINGS, ActionSettings


def _number(default: float, low: float, high: float, unit: str, text: str) -> Any:
    """Declare a field with its bounds, unit and explanation."""
    return field(
        default=default, metadata={"low": low, "high": high, "unit": unit, "help": text}
    )


def _choice(default: str, choices: Iterable[str], text: str) -> Any:
    """Declare a field that takes one of several names, with its explanation."""
    return field(default=default, metadata={"choices": tuple(choices), "help": text})


MOTIONS = ("library", "reaches")
AUGMENTATIONS = ("sampled", "replayed")
OBSERVATIONS = ("features", "body")


@dataclass(frozen=True, slots=True, kw_only=True)
class Preset:
    """TD3 on the pick scenario: all that a training run depends on besides its seed.

    The defaults are those of ``pick-td3``. Source: METHOD 3.3 and 3.5 for the form.
    Deviates: table 5.2's values; these are the ones that learn in minutes:
    residual action, features, n-step returns, batched cells). The source's recipe is its own
    preset.
    """

    name: str = "pick-td3"
    """Name in requests."""
    cell: str = "pick-and-place"
    """Work cell trained in."""

    total_steps: int = _number(
        4_608_000, 1_000, 100_000_000, "env steps", "length of the training"
    )
    n_envs: int = _number(128, 8, 1024, "", "cells stepped together")
    buffer_size: int = _number(
        400_000, 2_000, 2_000_000, "transitions", "size of the replay memory"
    )
    batch_size: int = _number(512, 16, 4096, "transitions", "minibatch of an update")
    learning_starts: int = _number(
        25_600, 0, 1_000_000, "env steps", "steps before the first update"
    )
    lr_start: float = _number(5e-4, 1e-6, 1e-2, "", "learning rate at the start")
    lr_end: float = _number(3e-5, 1e-7, 1e-2, "", "learning rate at the end")
    gamma: float = _number(0.993, 0.5, 0.9999, "per step", "discount")
    n_steps: int = _number(5, 1, 20, "steps", "length of n-step returns")
    tau: float = _number(0.005, 1e-4, 1.0, "", "target update factor")
    policy_delay: int = _number(2, 1, 10, "updates", "critic updates per actor update")
    target_noise: float = _number(0.1, 0.0, 1.0, "", "smoothing noise on target actions")
    target_noise_clip: float = _number(0.25, 0.0, 1.0, "", "bound of the smoothing noise")
    actor_frozen_updates: int = _number(
        3_000, 0, 1_000_000, "updates", "critic updates before the actor learns"
    )
    width: int = _number(256, 16, 1024, "units", "width of the hidden layers")

    sigma_max: float = _number(0.5, 0.0, 2.0, "", "strongest exploration noise")
    noise_time_s: float = _number(0.2, 0.05, 5.0, "s", "correlation time of the noise")
    greedy_share: float = _number(
        0.125, 0.01, 1.0, "", "share of cells without exploration; the curve is theirs"
    )
    option_rate: float = _number(
        0.02, 0.0, 0.5, "per step", "how often a random option starts in half the cells"
    )

    time_limit_s: float = _number(20.0, 1.0, 60.0, "s", "longest episode")
    short_limit_s: float = _number(10.0, 1.0, 60.0, "s", "time left in short episodes")
    short_share: float = _number(0.5, 0.0, 1.0, "", "share of short episodes")
    start_clearance_m: float = _number(
        0.05, 0.0, 0.5, "m", "least distance of robot and person at the start"
    )
    target_jitter_m: float = _number(
        0.04, 0.0, 0.2, "m", "half width of the box around a station for targets"
    )
    way_share: float = _number(0.15, 0.0, 1.0, "", "episodes that start on the way")
    human_motion: str = _choice(
        "library", MOTIONS, "what the person does: task primitives or the first reaches"
    )
    augmentation: str = _choice(
        "sampled", AUGMENTATIONS, "primitives sampled and varied, or demonstrations replayed"
    )
    n_people: int = _number(2, 1, 4, "", "people in a cell; the policy sees the nearest")
    human_absent: float = _number(
        0.35, 0.0, 1.0, "", "share of people who are not there in an episode"
    )
    human_roaming: float = _number(
        0.2, 0.0, 1.0, "", "share of people who do anything but the task"
    )
    human_pace: float = _number(1.0, 0.2, 2.0, "", "speed of the person, 1 = as cycled")
    human_courtesy: float = _number(
        0.0, 0.0, 1.0, "", "how far the person gives way to the arm; 0 does not see it"
    )
    observation: str = _choice(
        "features", OBSERVATIONS, "what the networks see: features, or the body's size too"
    )

    action_degree: int = _number(
        2, 2, 3, "", "degree of the motion in a period: 2 limits acceleration, 3 also jerk"
    )
    action_bounds: str = _choice(
        "viable", BOUNDS, "viable never exceeds a limit; one-step is the source's (degree 2)"
    )
    action_meaning: str = _choice(
        "speed", MEANINGS, "what an action is: a wanted joint speed or a place in the interval"
    )

    c_d: float = _number(1.0, 0.0, 10.0, "1/m", "reward for progress toward the target")
    c_th: float = _number(0.25, 0.0, 10.0, "1/rad", "reward for an upright tool")
    c_c: float = _number(5.0, 0.0, 100.0, "", "cost of a collision")
    c_step: float = _number(0.005, 0.0, 1.0, "", "cost of a control period")
    c_v: float = _number(0.0, 0.0, 10.0, "s/m", "cost of tcp speed near the target")
    d_v: float = _number(0.1, 0.0, 1.0, "m", "distance within which tcp speed costs")
    c_s: float = _number(4.0, 0.0, 100.0, "", "bonus of a success")

    progress_steps: int = _number(
        51_200, 128, 1_000_000, "env steps", "steps between two points of the curve"
    )
    checkpoint_steps: int = _number(
        512_000, 128, 10_000_000, "env steps", "steps between two checkpoints"
    )

    @property
    def action(self) -> ActionSettings:
        """How the scenario reads actions."""
        return ActionSettings(
            degree=self.action_degree, bounds=self.action_bounds, meaning=self.action_meaning
        )


def action_of(preset: Mapping[str, Any]) -> ActionSettings:
    """Return what actions mean to a checkpoint, from the preset in its manifest."""
    known = ActionSettings()
    return ActionSettings(
        degree=preset.get("action_degree", known.degree),
        bounds=preset.get("action_bounds", known.bounds),
        meaning=preset.get("action_meaning", known.meaning),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldInfo:
    """One field of a preset that a job may override."""

    name: str
    """Name of the field."""
    type: str
    """``"int"``, ``"float"`` or ``"choice"``."""
    default: float | str
    """Value in the preset."""
    minimum: float | None
    """Least allowed value; None for a choice."""
    maximum: float | None
    """Greatest allowed value; None for a choice."""
    choices: tuple[str, ...] | None
    """Allowed names; None for a number."""
    unit: str
    """Unit; empty for a plain number."""
    help: str
    """What it does, for people."""


PRESETS: Mapping[str, Preset] = MappingProxyType({"pick-td3": Preset()})
"""Every preset by name."""


def get(name: str) -> Preset:
    """Return a preset.

    Raises:
        NotFound: No preset has that name.
    """
    if name not in PRESETS:
        raise NotFound("preset", name, tuple(PRESETS))
    return PRESETS[name]


def fields(name: str) -> list[FieldInfo]:
    """Return the fields of a preset that a job may override, in order.

    Raises:
        NotFound: No preset has that name.
    """
    preset = get(name)
    return [_info(entry, preset) for entry in dataclasses.fields(preset) if entry.metadata]


def _info(entry: "dataclasses.Field[Any]", preset: Preset) -> FieldInfo:
    default, choices = getattr(preset, entry.name), entry.metadata.get("choices")
    number = "int" if isinstance(default, int) else "float"
    return FieldInfo(
        name=entry.name,
        type="choice" if choices else number,
        default=default,
        minimum=entry.metadata.get("low"),
        maximum=entry.metadata.get("high"),
        choices=choices,
        unit=entry.metadata.get("unit", ""),
        help=entry.metadata["help"],
    )


def resolve(name: str, overrides: Mapping[str, object]) -> Preset:
    """Return a preset with overrides applied.

    Args:
        name: Name of the preset.
        overrides: Field to value.

    Raises:
        NotFound: No preset has that name.
        InvalidInput: An unknown field, or a value outside its bounds.
    """
    known = {info.name: info for info in fields(name)}
    checked: dict[str, Any] = {}
    for key, value in overrides.items():
        if key == "cell":
            checked[key] = _checked_cell(value)
            continue
        if key not in known:
            raise InvalidInput(
                f"overrides.{key}", value, f"is no field of {name}", ("cell", *known)
            )
        checked[key] = _checked(known[key], value)
    preset = dataclasses.replace(get(name), **checked)
    _check_together(preset)
    return preset


def _checked_cell(value: object) -> str:
    """Return the name of a cell; whether there is one of that name is for others to say."""
    if not isinstance(value, str) or not re.fullmatch(r"[a-z][a-z0-9-]{0,63}", value):
        raise InvalidInput("overrides.cell", value, "must be the name of a work cell")
    return value


def _checked(info: FieldInfo, value: object) -> int | float | str:
    path = f"overrides.{info.name}"
    if info.minimum is None or info.maximum is None:
        if not isinstance(value, str) or value not in (info.choices or ()):
            raise InvalidInput(path, value, "must be one of the choices", info.choices or ())
        return value
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidInput(path, value, "must be a number")
    if not math.isfinite(value):
        raise InvalidInput(path, value, "must be finite")
    if info.type == "int" and value != int(value):
        raise InvalidInput(path, value, "must be a whole number")
    if not info.minimum <= value <= info.maximum:
        unit = f" {info.unit}" if info.unit else ""
        raise InvalidInput(
            path, value, f"must lie in [{info.minimum:g}, {info.maximum:g}]{unit}"
        )
    return int(value) if info.type == "int" else float(value)


def _check_together(preset: Preset) -> None:
    rounds = (
        ("total_steps", preset.total_steps, preset.n_envs, "n_envs"),
        ("progress_steps", preset.progress_steps, preset.n_envs, "n_envs"),
        (
            "checkpoint_steps",
            preset.checkpoint_steps,
            preset.progress_steps,
            "progress_steps",
        ),
    )
    for name, value, unit, of in rounds:
        if value % unit:
            near = max(unit, round(value / unit) * unit)
            raise InvalidInput(
                f"overrides.{name}", value, f"must be a multiple of {of} = {unit}, say {near}"
            )
    if preset.action_degree == 3 and preset.action_bounds != "viable":
        raise InvalidInput(
            "overrides.action_bounds",
            preset.action_bounds,
            "must be viable with action_degree = 3",
        )
    if preset.buffer_size < 16 * preset.n_envs:
        raise InvalidInput(
            "overrides.buffer_size",
            preset.buffer_size,
            f"must be at least 16 n_envs = {16 * preset.n_envs}",
        )
    if preset.short_limit_s > preset.time_limit_s:
        raise InvalidInput(
            "overrides.short_limit_s",
            preset.short_limit_s,
            f"must not exceed time_limit_s = {preset.time_limit_s:g} s",
        )
    if preset.learning_starts >= preset.total_steps:
        raise InvalidInput(
            "overrides.learning_starts",
            preset.learning_starts,
            f"must be below total_steps = {preset.total_steps}",
        )
