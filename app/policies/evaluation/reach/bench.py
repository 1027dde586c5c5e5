"""Evaluate one checkpoint of the reach scenario under several rules.

Every row of a result states its rules (``stated_rules``), because they change results by
several points: initial states, time limit, people and inference mode.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from app.errors import InvalidInput
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.trained_cell import cell_of
from app.policies.evaluation.reach.episodes import (
    MAX_TIME_LEFT_S,
    ReachEpisodes,
    recheck_contacts,
    run_episodes,
    target_goals,
)
from app.policies.evaluation.rows import Json, OnRow, ignore_row
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """Episodes of one result row."""

    name: str
    """Name of the row."""
    settings: ReachSettings
    """Rules of the episodes."""
    goals: Vec
    """Goal of each episode [m], shape (n, 3)."""
    goal_set: str = "grid"
    """Set of the goals, stated with the row."""
    mode: InferenceMode = InferenceMode.DIRECT
    """Inference mode."""
    cell: Cell | None = None
    """Work cell; None: the cell of the checkpoint."""
    controller: Controller | None = None
    """Controller of the robots; None: the policy in its inference mode."""
    stated: Mapping[str, Any] = field(default_factory=dict)
    """Further rules stated with the row."""


Measure = Callable[[Variant, ReachEpisodes], Json]
"""Further measures of a row."""


def suffix_of(mode: InferenceMode) -> str:
    """Return the suffix of row names: empty without rollout."""
    return ROLLOUT if mode.rollout else ""


def pedestrian_of(cell: Cell) -> CylinderPerson:
    """Return the first pedestrian of a cell.

    Raises:
        InvalidInput: The cell has no pedestrian.
    """
    if not cell.cylinders:
        rule = "must have been trained in a cell with a pedestrian"
        raise InvalidInput("checkpoint", cell.name, rule)
    return cell.cylinders[0]


class ReachBench:
    """Evaluate one checkpoint under several rules.

    Args:
        seed: Seed of the episodes; use one that was not used for tuning.
        on_row: Callback for each finished row.
    """

    def __init__(self, checkpoint: Checkpoint, seed: int, on_row: OnRow = ignore_row) -> None:
        self.actor = ReachPolicy(checkpoint)
        self.cell = cell_of(checkpoint.manifest)
        self.targets: Vec = goal_region_of(self.cell).targets()
        modes = inference_modes_of(self.actor)
        self.goal_modes = tuple(mode for mode in modes if not mode.distance_weighted)
        """Inference modes for goals between the training targets."""
        self.direct_modes = tuple(mode for mode in self.goal_modes if not mode.interpolated)
        """Inference modes that query the policy for the goal itself."""
        self._seed, self._on_row = seed, on_row
        self._rows: list[Json] = []
        self._stated: dict[str, Json] = {}
        self._recheck: Json = {}

    @property
    def usual(self) -> ReachSettings:
        """Default rules: grid, start clearance 0.05 m, 5 s; limits and contacts as trained."""
        return ReachSettings(
            action=self.actor.action,
            observation=self.actor.view,
            limits=self.actor.limits,
            blocked=self.actor.blocked,
            collision_ends=self.actor.blocked is None,
            start="clearance",
            start_clearance_m=0.05,
            time_limit_s=5.0,
        )

    def variant(
        self, name: str, goals: Vec, mode: InferenceMode = InferenceMode.DIRECT, **rules: Any
    ) -> Variant:
        """Return a variant with the default rules except ``rules``."""
        settings = replace(self.usual, **rules)
        return Variant(name=name, settings=settings, goals=goals, mode=mode)

    def target_goals(self, n: int) -> Vec:
        """Return the goals of ``n`` episodes that cycle through the targets [m], (n, 3)."""
        return target_goals(self.targets, n)

    def run(self, variant: Variant) -> ReachEpisodes:
        """Run one episode per goal of a variant."""
        controller = variant.controller or controller_of(self.actor, variant.mode)
        cell = variant.cell or self.cell
        return run_episodes(cell, variant.settings, controller, variant.goals, self._seed)

    def on_targets(
        self, per_target: int, mode: InferenceMode = InferenceMode.DIRECT
    ) -> ReachEpisodes:
        """Run the episodes of the row ``clearance`` of ``reach-targets``."""
        goals = self.target_goals(per_target * len(self.targets))
        return self.run(self.variant("clearance", goals, mode))

    def measure(
        self, variants: Sequence[Variant], more: Measure = lambda _variant, _episodes: {}
    ) -> None:
        """Run variants and add the row of each."""
        for variant in variants:
            episodes = self.run(variant)
            row = {**episodes.row(variant.name), **more(variant, episodes)}
            self.add(row, variant, len(variants))

    def recheck(self, variant: Variant) -> None:
        """Check the poses of a variant's first episodes with FCL; the result states them."""
        controller = controller_of(self.actor, variant.mode)
        shared = self.cell, variant.settings, controller, variant.goals, self._seed
        self._recheck = {"fcl_recheck": recheck_contacts(*shared)}

    def add(self, row: Json, variant: Variant, n_rows: int = 1) -> None:
        """Add a row and its rules."""
        self._stated[row["name"]] = {
            **stated_rules(variant.cell or self.cell, variant.settings),
            "goals": variant.goal_set,
            "inference_mode": variant.mode,
            **variant.stated,
        }
        self._rows.append(row)
        self._on_row(len(self._rows), n_rows, row)

    def result(self, **more: Any) -> Json:
        """Return the result."""
        return {
            "policy": self.actor.title,
            "settings": {
                "cell": self.cell.name,
                "base_height_m": self.cell.table.height,
                "success_distance_m": SUCCESS_DISTANCE,
                "max_time_left_s": MAX_TIME_LEFT_S,
                "trained_goals": self.actor.goals,
                "observation": self.actor.view,
                "action": asdict(self.actor.action),
                **more,
                "rows": self._stated,
            },
            "results": self._rows,
            **self._recheck,
        }
