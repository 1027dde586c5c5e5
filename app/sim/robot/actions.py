"""Action types of the scenarios: degree, bounds and meaning (docs/method.md 2.2).

degree 2   acceleration-limited, closed form           robot/kernels/acceleration_bounds.py
degree 3   jerk-limited, ends by bisection             robot/kernels/jerk_bounds.py

viable     recursively feasible: never empty, and all limits hold
one-step   the thesis' bounds of one period; they can become empty: *unfeasible*

speed        a in [-1, 1] is a desired share of the speed limit; the nearest admissible
             speed is reached
coefficient  a in [-1, 1] is a position in the admissible interval, the thesis' map (4.23)
"""

from dataclasses import dataclass

from app.errors import InvalidInput
from app.sim.robot.kernels.actions import COEFFICIENT, MYOPIC, SPEED, VIABLE, ActionRule

DEGREES = (2, 3)
"""Degrees of the polynomial."""
BOUNDS = {"viable": VIABLE, "one-step": MYOPIC}
"""Kinds of bounds by name."""
MEANINGS = {"speed": SPEED, "coefficient": COEFFICIENT}
"""Meanings of actions, by name."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ActionSettings:
    """Motion of a joint by an action in [-1, 1].

    Raises:
        InvalidInput: An unknown choice, or one-step bounds for degree 3.
    """

    degree: int = 2
    """Degree of the polynomial: 2 limits acceleration, 3 also jerk."""
    bounds: str = "viable"
    """``"viable"`` or ``"one-step"`` (degree 2 only)."""
    meaning: str = "speed"
    """``"speed"`` or ``"coefficient"``."""

    def __post_init__(self) -> None:
        if self.degree not in DEGREES:
            raise InvalidInput("degree", self.degree, "must be 2 or 3")
        if self.bounds not in BOUNDS:
            raise InvalidInput("bounds", self.bounds, "must name bounds", tuple(BOUNDS))
        if self.meaning not in MEANINGS:
            raise InvalidInput("meaning", self.meaning, "must name a meaning", tuple(MEANINGS))
        if self.degree == 3 and self.bounds == "one-step":
            raise InvalidInput("bounds", self.bounds, "must be viable for degree 3")

    def rule(self) -> ActionRule:
        """Return the same for the kernels."""
        return ActionRule(self.degree, BOUNDS[self.bounds], MEANINGS[self.meaning])
