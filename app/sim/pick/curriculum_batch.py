"""Pick environments whose robots start part of the path to the target (docs/method.md 3.5).

The fraction of the straight joint path from the target (0) to the sampled start (1) has a
triangular distribution with the upper limit 1; a training moves its mode and its lower limit.
A fraction at which the robot would be nearer to a person than at other starts, or in contact,
is drawn again; the last of ``FRACTION_TRIES`` tries is the sampled start itself.

Source: thesis section 5.3.4.
"""

from typing import Any, NamedTuple

import numpy as np

from app.sim.pick.batch import PickBatch
from app.sim.pick.kernels import starts
from app.sim.robot.kernels.arm import CONTROLLED
from app.sim.scenario.kernels.episode import Indices

FRACTION_TRIES = 20
"""Tries of a fraction of the path; the last is 1."""


class StartRange(NamedTuple):
    """Triangular distribution of the fraction; its upper limit is 1."""

    low: float
    """Lower limit."""
    mode: float
    """Mode, from ``low`` to 1."""

    def fraction(self, u: float) -> float:
        """Return the fraction whose cumulative probability is ``u``, in [0, 1)."""
        low, mode = self
        span = 1.0 - low
        if u * span < mode - low:
            return float(low + np.sqrt(u * span * (mode - low)))
        return float(1.0 - np.sqrt((1.0 - u) * span * (1.0 - mode)))


class CurriculumPickBatch(PickBatch):
    """Pick environments with starts between target and start; arguments as PickBatch."""

    starts = StartRange(1.0, 1.0)
    """Distribution of the next starts."""

    def _start(self, envs: Indices) -> None:
        """Start episodes in some environments."""
        super()._start(envs)
        if self.starts.low < 1.0:
            for env in envs:
                self._draw_fraction(int(env))

    def _draw_fraction(self, env: int) -> None:
        """Move the robot of an environment along the path; people stay as they are."""
        state = _row(self.state, env)
        episode, far, goal = int(state.episode[0]), state.q.copy(), state.q_goal
        rng = np.random.default_rng((self.seed, self._first + env, episode))
        for left in reversed(range(FRACTION_TRIES)):
            part = self.starts.fraction(rng.random()) if left else 1.0
            n = CONTROLLED
            state.q[0, :n] = goal[0, :n] + part * (far[0, :n] - goal[0, :n])
            shared = self.world, self.settings.grasp, state, self._work
            self._call(starts.measure_starts, *shared)
            clear = state.clear[0]
            if clear[0] >= self._task.rules.start_clearance and clear[1:].min() > 0.0:
                return


def _row(state: Any, env: int) -> Any:
    """Return one environment of a state as views of its arrays, shape (1, ...) each."""
    if isinstance(state, np.ndarray):
        return state[env : env + 1]
    return type(state)(*(_row(part, env) for part in state))
