"""A real network with random weights that moves the arm: what an untrained policy is."""

import numpy as np
from numpy.typing import NDArray

from app.sim.cells.cell import Cell, load_cell
from app.sim.reach.batch import VIEWS
from app.sim.reach.goal_sets import halton_targets
from app.sim.robot.actions import ActionSettings


class RandomActor:
    """Two hidden layers of tanh; every input counts, so that every difference shows."""

    checkpoint, title = "7" * 64, "random actor"

    def __init__(
        self,
        goals: str = "grid",
        view: str = "features",
        action: ActionSettings | None = None,
        cell: Cell | None = None,
        trained_range: dict[str, dict[str, list[float]]] | None = None,
    ) -> None:
        cell = cell or load_cell("shared-workspace")
        self.goals, self.view, self.action = goals, view, action or ActionSettings()
        self.cell, self.cell_sha256 = cell.name, cell.sha256
        region = cell.goal_region
        known = dict.fromkeys(("grid", "in-turn"), region.targets)
        known["halton"] = lambda: halton_targets(region)
        self.targets = known[goals]() if goals in known else None
        self.trained_range = trained_range or {}
        rng = np.random.default_rng(12)
        sizes = (VIEWS[view][1], 32, 32, 6)
        self._layers = [
            rng.normal(0.0, 1.0 / np.sqrt(n), (n, m)).astype(np.float32)
            for n, m in zip(sizes, sizes[1:], strict=False)
        ]

    def acts(self, obs: NDArray[np.float32]) -> NDArray[np.float32]:
        for layer in self._layers:
            obs = np.tanh(obs @ layer)
        return obs
