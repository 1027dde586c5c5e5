"""Order rules: selection among near-optimal sorting moves (docs/method.md 3.1).

All rules choose among the same moves: those that the exact planner expects to take about as
many attempts as its own.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from app.policies.evaluation.statistics import Index
from app.policies.inference.task_selection import HYSTERESIS, select
from app.sim.core.arrays import Vec


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderView:
    """Input of an order rule: the targets of n tasks at one step, the planner's own first."""

    values: NDArray[np.float32]
    """Critic's value of each target, plus that of the motion to its place while nothing is
    held; -inf where there are fewer, shape (n, k)."""
    distances: Vec
    """Distance from the tcp to each target [m], inf where there are fewer, shape (n, k)."""
    chosen: Index
    """Target pursued so far, -1 at the start of a motion, shape (n,)."""


OrderRule = Callable[[OrderView], Index]


def planner(view: OrderView) -> Index:
    """Follow the planner's own move."""
    return np.zeros(len(view.values), dtype=np.int64)


def nearest(view: OrderView) -> Index:
    """Choose the target nearest to the tcp at the start of each motion."""
    return np.where(view.chosen < 0, view.distances.argmin(axis=1), view.chosen)


def critic(view: OrderView) -> Index:
    """Choose the target of the greatest value at every step, with hysteresis."""
    kept = select(view.values, np.maximum(view.chosen, 0), HYSTERESIS)
    return np.where(view.chosen < 0, view.values.argmax(axis=1), kept)


ORDER_RULES: Mapping[str, OrderRule] = MappingProxyType(
    {"critic": critic, "planner": planner, "nearest": nearest}
)
"""Order rules by name."""
