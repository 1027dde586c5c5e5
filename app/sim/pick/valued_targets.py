"""Pick environments whose targets are chosen by their values, as task selection chooses them.

In training this choice is the cause of the *task maximisation bias*: a target whose value is
underestimated is not tried, so its value and the policy toward it are not corrected.

Source: thesis section 5.2, docs/method.md 3.1. Deviates: the choice is made once, at the start
of an episode; the thesis chooses again at each step.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from app.sim.pick.batch import Flags, PickBatch
from app.sim.robot.kernels.arm import CONTROLLED
from app.sim.scenario.kernels.episode import Indices

Values = Callable[[NDArray[np.float32]], NDArray[np.floating]]
"""Returns the values, shape (n,), of observations, shape (n, obs_size)."""


class ValuedTargetBatch(PickBatch):
    """Pick environments that start with the station of the greatest value as their target.

    The station at which the robot stands is not offered. Arguments as PickBatch.
    """

    values: Values | None = None
    """The values; None keeps the targets drawn uniformly."""

    def _start(self, envs: Indices) -> None:
        """Start episodes in some environments."""
        super()._start(envs)
        if self.values is not None:
            self.take(envs, self.station_values(envs, self.values).argmax(axis=1))

    def station_values(self, envs: Indices, values: Values) -> NDArray[np.floating]:
        """Return the value of each station as target, -inf where the robot stands there.

        The last station is the target afterwards.

        Args:
            envs: Numbers of environments that have just started, shape (k,).
            values: Returns the values of observations.

        Returns:
            Values, shape (k, n_stations).
        """
        n_stations = len(self.world.stations)
        obs = np.empty((n_stations, len(envs), self.obs_size), dtype=np.float32)
        for station in range(n_stations):
            self.take(envs, np.full(len(envs), station))
            self._observe(envs, obs[station])
        found = values(obs.reshape(-1, self.obs_size)).reshape(n_stations, -1).T
        return np.where(self._at_stations(envs), -np.inf, found)

    def take(self, envs: Indices, stations: Indices) -> None:
        """Set stations, shape (k,), as the targets of environments, shape (k,)."""
        self.state.candidates[envs, 0] = stations
        self.set_goals(envs, self.world.stations[stations])

    def _at_stations(self, envs: Indices) -> Flags:
        """Return whether the robot stands at each station, shape (k, n_stations)."""
        away = self.state.q[envs, None, :CONTROLLED] - self.world.station_q[:, :CONTROLLED]
        at: Flags = np.all(away == 0.0, axis=2)
        return at
