"""What the protocols of the reach scenario share: a policy, its cell, its rules, its rows.

Every row states its rules (``stated_rules``), for they move results by points: how episodes
start, how long they may last, who is there, and by which way the policy is asked.
"""

from dataclasses import asdict
from typing import Any

import numpy as np

from app.errors import InvalidInput
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.trained_cell import cell_of
from app.policies.evaluation.reach.episodes import (
    REPORTED_TIME_LEFT_S,
    ReachEpisodes,
    play,
    random_goals,
    recheck_contacts,
    target_goals,
)
from app.policies.evaluation.rows import OnRow, ignore_row
from app.policies.inference.controllers import (
    ROLLOUT,
    Controller,
    InferenceMode,
    controller_of,
    inference_modes_of,
)
from app.policies.inference.reach_policy import ReachPolicy
from app.sim.cells.cell import Cell
from app.sim.cells.people import CylinderPerson
from app.sim.core.arrays import Vec
from app.sim.reach.batch import ReachSettings, goal_region_of, stated_rules
from app.sim.scenario.kernels.episode import SUCCESS_DISTANCE

Json = dict[str, Any]


def goal_ways(actor: ReachPolicy) -> tuple[InferenceMode, ...]:
    """Return the ways of asking a policy for goals between those it was trained on."""
    return tuple(mode for mode in inference_modes_of(actor) if not mode.averaged)


def direct_ways(actor: ReachPolicy) -> tuple[InferenceMode, ...]:
    """Return the ways of asking a policy for the goal itself: alone, and looking ahead."""
    return tuple(
        mode for mode in inference_modes_of(actor) if not (mode.averaged or mode.interpolated)
    )


def ending(mode: InferenceMode) -> str:
    """Return what the names of rows end with: nothing for the policy alone."""
    return ROLLOUT if mode.rollout else ""


def walker_of(cell: Cell) -> CylinderPerson:
    """Return the first person of a cell who walks about as a cylinder.

    Raises:
        InvalidInput: There is none.
    """
    if not cell.cylinders:
        rule = "must have been trained in a cell with somebody who walks about"
        raise InvalidInput("checkpoint", cell.name, rule)
    return cell.cylinders[0]


class ReachBench:
    """Evaluates one checkpoint under varied rules.

    Args:
        checkpoint: What acts.
        seed: Seed of the episodes; use one that nothing was tuned on.
        on_row: Told of each row once it is known.
    """

    def __init__(self, checkpoint: Checkpoint, seed: int, on_row: OnRow = ignore_row) -> None:
        self.actor = ReachPolicy(checkpoint)
        self.cell = cell_of(checkpoint.manifest)
        region = goal_region_of(self.cell)
        self.targets: Vec = region.targets()
        middle, half = np.array(region.center), 0.5 * np.array(region.size)
        self.low, self.high = middle - half, middle + half
        self.n_rows = 1
        """How many rows the result will have."""
        self._seed, self._on_row = seed, on_row
        self._rows: list[Json] = []
        self._stated: dict[str, Json] = {}
        self._recheck: Json | None = None

    @property
    def usual(self) -> ReachSettings:
        """The rules unless a row says otherwise: grid, start clearance 0.05 m, 5 s."""
        return ReachSettings(
            action=self.actor.action,
            observation=self.actor.view,
            start="clearance",
            start_clearance_m=0.05,
            time_limit_s=5.0,
        )

    def target_goals(self, n: int) -> Vec:
        """Return the goals of ``n`` episodes round all targets [m], shape (n, 3)."""
        return target_goals(self.targets, n)

    def random_goals(self, n: int) -> Vec:
        """Return ``n`` goals anywhere in the box [m], shape (n, 3)."""
        return random_goals(self.low, self.high, n, self._seed)

    def play(
        self,
        settings: ReachSettings,
        goals: Vec,
        how: InferenceMode = InferenceMode.DIRECT,
        *,
        cell: Cell | None = None,
        controller: Controller | None = None,
    ) -> ReachEpisodes:
        """Play an episode per goal.

        Args:
            settings: Rules.
            goals: Goal of each episode [m], shape (n, 3).
            how: By which way the policy is asked.
            cell: Work cell, where it is not the checkpoint's.
            controller: Controller in place of the inference mode; None: that of `how`.
        """
        asked = controller or controller_of(self.actor, how)
        return play(cell or self.cell, settings, asked, goals, self._seed)

    def recheck(
        self, settings: ReachSettings, goals: Vec, how: InferenceMode = InferenceMode.DIRECT
    ) -> None:
        """Ask FCL about the poses of the first episodes; the result will say what it found."""
        asked = controller_of(self.actor, how)
        self._recheck = recheck_contacts(self.cell, settings, asked, goals, self._seed)

    def add(
        self,
        row: Json,
        settings: ReachSettings,
        goals: str,
        how: InferenceMode = InferenceMode.DIRECT,
        *,
        cell: Cell | None = None,
        **more: Any,
    ) -> None:
        """Add a row and what it states of its rules.

        Args:
            row: With its name.
            settings: Its rules.
            goals: Where its goals were, in words.
            how: By which way the policy was asked.
            cell: Work cell, where it is not the checkpoint's.
            more: What else it states.
        """
        rules = stated_rules(cell or self.cell, settings)
        self._stated[row["name"]] = {**rules, "goals": goals, "asked": how, **more}
        self._rows.append(row)
        self._on_row(len(self._rows), self.n_rows, row)

    def result(self, **more: Any) -> Json:
        """Return the whole result.

        Args:
            more: What else the settings state.
        """
        found = {} if self._recheck is None else {"fcl_recheck": self._recheck}
        return {
            "policy": self.actor.title,
            "settings": {
                "cell": self.cell.name,
                "base_height_m": self.cell.table.height,
                "success_distance_m": SUCCESS_DISTANCE,
                "time_told_s": REPORTED_TIME_LEFT_S,
                "trained_goals": self.actor.goals,
                "observation": self.actor.view,
                "action": asdict(self.actor.action),
                **more,
                "rows": self._stated,
            },
            "results": self._rows,
            **found,
        }
