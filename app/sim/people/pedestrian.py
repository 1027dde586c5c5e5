"""Settings of pedestrians, people as vertical cylinders that walk.

``people/kernels/pedestrian.py`` computes the motion.

Source: docs/method.md 2.1, with its constants as defaults.
"""

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from typing import Any, Literal

import numpy as np

from app.errors import InvalidInput
from app.sim.people.kernels.pedestrian import (
    CONSTANT,
    FIXED_SPEED,
    N_RULES,
    N_STATE,
    WALKER,
    PedestrianRules,
    PedestrianState,
)

PedestrianKind = Literal["walker", "constant", "fixed-speed"]
PEDESTRIAN_KINDS: dict[PedestrianKind, int] = {
    "walker": WALKER,
    "constant": CONSTANT,
    "fixed-speed": FIXED_SPEED,
}
"""Speed and radius of docs/method.md 2.1; both constant per episode; a given speed."""


AUTHORS_WALK: dict[str, Any] = {"apart": 0.5, "inside": 1.0, "hurried": True, "p_go_on": 0.01}
"""Settings of the authors' public code beyond docs/method.md 2.1."""

_RANGES = (("v_min", "v_max"), ("r_min", "r_max"), ("x_min", "x_max"), ("y_min", "y_max"))


@dataclass(frozen=True, slots=True, kw_only=True)
class PedestrianSettings:
    """One pedestrian (docs/method.md 2.1).

    Raises:
        InvalidInput: A value is not finite, out of range, or above its upper bound.
    """

    kind: PedestrianKind = "walker"
    """Variant of the motion."""
    v_min: float = 0.3
    """Lowest walking speed; slower counts as standing [m/s]."""
    v_max: float = 1.0
    """Highest walking speed [m/s]."""
    r_min: float = 0.2
    """Smallest radius [m]."""
    r_max: float = 0.5
    """Largest radius [m]."""
    f_speed_max: float = 1.0
    """Highest frequency of the speed function [Hz]."""
    f_radius_max: float = 0.5
    """Highest frequency of the radius function [Hz]."""
    x_min: float = -2.0
    """Walking area, left edge [m]."""
    x_max: float = 1.0
    """Walking area, right edge [m]."""
    y_min: float = 0.5
    """Walking area, near edge [m]."""
    y_max: float = 2.0
    """Walking area, far edge [m]."""
    tolerance: float = 0.1
    """Distance at which a target counts as reached [m]."""
    p_still: float = 0.05
    """Probability of standing still for a whole episode."""
    p_stay: float = 0.1
    """Probability of staying at a reached target for the rest of the episode."""
    fixed_speed: float = 0.5
    """Speed of kind ``fixed-speed`` [m/s]; the limits of the speed do not apply to it."""
    apart: float = 0.0
    """Smallest distance to a new target [m]."""
    inside: float = 0.0
    """Distance of targets from the edges of the walking area, in radii."""
    hurried: bool = False
    """Whether the speed is at least ``v_min`` in the first period."""
    p_go_on: float = 0.0
    """Probability per period of leaving a target after staying at it."""

    def __post_init__(self) -> None:
        if self.kind not in PEDESTRIAN_KINDS:
            raise InvalidInput(
                "kind", self.kind, "must be a kind of pedestrian", list(PEDESTRIAN_KINDS)
            )
        for field in fields(self)[1:]:
            value = getattr(self, field.name)
            if not math.isfinite(value):
                raise InvalidInput(field.name, value, "must be finite")
            if value < 0.0 and field.name[:2] not in ("x_", "y_"):
                raise InvalidInput(field.name, value, "must not be negative")
        for low, high in _RANGES:
            least, greatest = getattr(self, low), getattr(self, high)
            if least > greatest:
                raise InvalidInput(low, least, f"must be at most {high} = {greatest}")
        if self.r_min == 0.0:
            raise InvalidInput("r_min", self.r_min, "must be positive")
        for name in ("p_still", "p_stay", "p_go_on"):
            if getattr(self, name) > 1.0:
                raise InvalidInput(name, getattr(self, name), "must lie in [0, 1]")


def pedestrian_rules(walkers: Sequence[PedestrianSettings]) -> PedestrianRules:
    """Return the rules of pedestrians as kernels take them."""
    rows = [(PEDESTRIAN_KINDS[walker.kind], *astuple(walker)[1:]) for walker in walkers]
    return PedestrianRules(rows=np.array(rows, dtype=np.float64).reshape(-1, N_RULES))


def pedestrian_state(n_envs: int, n_pedestrians: int) -> PedestrianState:
    """Return zeroed state of the pedestrians of ``n_envs`` environments."""
    return PedestrianState(
        rows=np.zeros((n_envs, n_pedestrians, N_STATE)),
        stream=np.zeros((n_envs, n_pedestrians, 1), dtype=np.uint64),
    )
