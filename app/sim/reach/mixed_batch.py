"""Reach environments with different numbers of people, stepped together.

An equal share of the environments has one person, two people, and so on, so that a policy
learns beside any number of people.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from app.errors import InvalidInput
from app.sim.cells.cell import Cell
from app.sim.reach.batch import N_ACT, ReachBatch, ReachSettings
from app.sim.scenario.step_result import StepResult
from app.state_dict import Stateful


class MixedReachBatch(Stateful):
    """One batch for each number of people.

    Args:
        cell: Work cell with a goal region.
        n_envs: Number of environments.
        seed: Seed; as in :class:`~app.sim.reach.batch.ReachBatch`.
        settings: Settings of the scenario; ``people`` are those of the largest group.

    Raises:
        InvalidInput: There are no people, or fewer environments than people.
    """

    STATE = ("parts",)

    def __init__(self, cell: Cell, n_envs: int, seed: int, settings: ReachSettings) -> None:
        people = settings.people or ()
        if not 0 < len(people) <= n_envs:
            raise InvalidInput(
                "people", len(people), f"must be 1 to {n_envs}, the number of environments"
            )
        n = len(people)
        starts = [n_envs * k // n for k in range(n + 1)]
        self.parts = tuple(
            ReachBatch(
                cell,
                starts[k + 1] - starts[k],
                seed,
                replace(settings, people=people[: k + 1]),
                starts[k],
            )
            for k in range(n)
        )
        """One batch for each number of people, in increasing order."""
        self.n_envs, self.n_act, self.seed = n_envs, N_ACT, seed
        self.obs_size, self.settings = self.parts[0].obs_size, settings
        self.cell, self.arm, self.world = (
            self.parts[-1].cell,
            self.parts[0].arm,
            self.parts[0].world,
        )
        self._ends = starts[1:-1]

    def reset(self) -> NDArray[np.float32]:
        """Start episode 0 in every environment; return observations, (n_envs, obs_size)."""
        return np.concatenate([part.reset() for part in self.parts])

    def step(self, act: NDArray[np.float32], *, auto_reset: bool = True) -> StepResult:
        """Move every environment through one control period; see :meth:`EnvBatch.step`."""
        each = [
            part.step(some, auto_reset=auto_reset)
            for part, some in zip(self.parts, np.split(act, self._ends), strict=True)
        ]
        return StepResult(
            obs=np.concatenate([result.obs for result in each]),
            last_obs=np.concatenate([result.last_obs for result in each]),
            rew=np.concatenate([result.rew for result in each]),
            ended=np.concatenate([result.ended for result in each]),
        )


ReachEnvironments = ReachBatch | MixedReachBatch
"""Environments in which a policy is trained."""
