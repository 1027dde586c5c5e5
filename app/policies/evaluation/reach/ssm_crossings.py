"""Policies, planners and an oracle on the same crossings under the safety layer."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count

import numpy as np
from numpy.typing import NDArray

from app.policies.evaluation.reach.episodes import run_to_end
from app.policies.inference.controllers import Controller
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.planning.goal_configurations import goal_configurations_of
from app.sim.planning.ompl_planners import PlanSettings
from app.sim.planning.replanning import ReplanningSettings
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.crossings import CrossingSet
from app.sim.reach.monitored.batch import MonitoredReachBatch
from app.sim.reach.monitored.planners import GOAL_SPREAD, drive_planner
from app.sim.reach.oracle_search import Acts, sample_detours, toward
from app.sim.robot.actions import ActionSettings
from app.sim.robot.kernels.arm import Arm
from app.sim.safety.layer import SafetySettings
from app.sim.scenario.monitoring import MonitoredEpisodes, MonitoringSettings, joined, selected
from app.sim.scene.scene import arm_of

MARGIN = 0.05
"""Distance of planned paths to people [m]: of 0.05 and 0.35 the one with which RRT* and
RRT-Connect arrived earlier on 20 crossings of another seed (77)."""
ASIDE = (-2.0, 2.0, 0.2)
"""x, y, radius of the person in rows without people [m]: far corner of the walking area of
docs/method.md 2.1. The cell is not empty, because training may contain no empty cell."""
LONGEST_WAIT = 8.0
"""Latest time at which a resimulation turns to its goal [s]."""
PLANNERS: Mapping[str, ReplanningSettings] = {
    "rrtstar-once": ReplanningSettings(
        role="plan-once", margin=MARGIN, plan=PlanSettings(planner="rrt-star", budget_s=1.0)
    ),
    "rrtconnect-blocked": ReplanningSettings(
        role="replan-on-blocked", margin=MARGIN, plan=PlanSettings(planner="rrt-connect")
    ),
    "aorrtc-blocked": ReplanningSettings(
        role="replan-on-blocked", margin=MARGIN, plan=PlanSettings(planner="aorrtc")
    ),
    "replan-every-cycle": ReplanningSettings(
        role="replan-every-cycle", margin=MARGIN, plan=PlanSettings(planner="rrt-connect")
    ),
}
"""Planners by row."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparisonSettings:
    """Planners and limits of a comparison."""

    planners: Mapping[str, ReplanningSettings]
    """Planners by row."""
    without_people: ReplanningSettings
    """Planner of the rows without people."""
    n_resimulations: int = 128
    """Resimulations of each crossing by the oracle."""
    time_limit_s: float = 20.0
    """Time limit of a crossing [s]."""


DEFAULT_SETTINGS = ComparisonSettings(
    planners=PLANNERS,
    without_people=ReplanningSettings(
        role="plan-once", plan=PlanSettings(planner="rrt-star", budget_s=0.2)
    ),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CrossingRuns:
    """Runs of one row."""

    episodes: MonitoredEpisodes
    """Result of each run."""
    overrides: list[Vec]
    """Override in [0, 1] of every period of each run; empty for the oracle."""


def run_monitored(batch: MonitoredReachBatch, acts: Acts) -> CrossingRuns:
    """Run the episodes of a batch that was reset to their ends."""
    found: list[Vec] = []
    run_to_end(batch, acts, after=lambda: found.append(batch.override.copy()), features=False)
    episodes, every = batch.runs(), np.array(found)
    periods = np.round(episodes.seconds / batch.arm.dt).astype(int)
    overrides = [every[:n, k] for k, n in enumerate(periods)]
    return CrossingRuns(episodes=episodes, overrides=overrides)


class Comparison:
    """Runs of policies, planners and the oracle over one set of crossings.

    Args:
        reach: Action and observation of the policy; time limit and people are replaced.
        seed: Seed of planners and oracle.
    """

    def __init__(
        self,
        cell: Cell,
        crossed: CrossingSet,
        reach: ReachSettings,
        safety: SafetySettings,
        seed: int,
        settings: ComparisonSettings = DEFAULT_SETTINGS,
    ) -> None:
        self.cell, self.crossed, self.safety, self.seed = cell, crossed, safety, seed
        self.settings = settings
        self._reach = replace(
            reach, people=("walker",), time_limit_s=settings.time_limit_s, start="uniform"
        )

    def batch(self, *, no_person: bool = False, monitored: bool = True) -> MonitoredReachBatch:
        """Return a batch at the start of all crossings."""
        aside = np.tile(np.array(ASIDE), (len(self.crossed.goals), 2, 1))
        tracks = aside if no_person else self.crossed.tracks
        monitoring = MonitoringSettings(active=monitored, rest_ends=False)
        return self._batch(tracks, self.crossed.goals, self._reach, monitoring)

    def copies(self, number: int, n: int) -> MonitoredReachBatch:
        """Return a batch of ``n`` copies of one crossing; actions are joint speeds."""
        rows = np.full(n, number)
        reach = replace(self._reach, action=ActionSettings())
        monitoring = MonitoringSettings(rest_ends=False)
        return self._batch(
            self.crossed.tracks[rows], self.crossed.goals[rows], reach, monitoring
        )

    def _batch(
        self, tracks: Vec, goals: Vec, reach: ReachSettings, monitoring: MonitoringSettings
    ) -> MonitoredReachBatch:
        n = len(goals)
        batch = MonitoredReachBatch(
            self.cell, n, self.seed, reach, self.safety, monitoring, tracks=tracks
        )
        batch.reset()
        batch.set_goals(np.arange(n), goals)
        return batch

    @cached_property
    def configurations(self) -> list[Vec]:
        """Configurations at each goal [rad], shape (k, 6) each."""
        goals = self.crossed.goals
        return goal_configurations_of(arm_of(self.cell), goals, self.seed, GOAL_SPREAD)

    def policy(self, controller: Controller, *, no_person: bool = False) -> CrossingRuns:
        """Run a policy over all crossings."""
        return run_monitored(self.batch(no_person=no_person), controller.acts)

    def planner(
        self,
        settings: ReplanningSettings,
        *,
        no_person: bool = False,
        blind: bool = False,
        monitored: bool = True,
    ) -> CrossingRuns:
        """Run a planner over all crossings; a blind one ignores people."""
        batch = self.batch(no_person=no_person, monitored=monitored)
        overrides = drive_planner(
            batch, self.configurations, settings, self.seed + 1, blind=blind
        )
        return CrossingRuns(episodes=batch.runs(), overrides=overrides)

    def run(self, controllers: Mapping[str, Controller]) -> Iterator[tuple[str, CrossingRuns]]:
        """Yield the runs of policies, planners and the oracle, by row."""
        for name, controller in controllers.items():
            yield name, self.policy(controller)
        for name, settings in self.settings.planners.items():
            yield name, self.planner(settings)
        planner = self.settings.without_people
        yield "policy-no-person", self.policy(controllers["policy"], no_person=True)
        yield "planner-no-person", self.planner(planner, no_person=True)
        yield "planner-no-ssm", self.planner(planner, blind=True, monitored=False)
        rng = np.random.default_rng(self.seed)
        best = best_resimulations(self, self.settings.n_resimulations, rng)
        for name, episodes in best.items():
            yield name, CrossingRuns(episodes=episodes, overrides=[])


def best_resimulations(
    comparison: Comparison, n_each: int, rng: np.random.Generator
) -> dict[str, MonitoredEpisodes]:
    """Return the best resimulations of each crossing under the safety layer, by row.

    If no resimulation of a crossing arrives untouched, the first one represents it; the
    least-stopped one only has to arrive.
    """
    found: dict[str, list[MonitoredEpisodes]] = {"oracle": [], "oracle-least-stopped": []}
    for number, configurations in enumerate(comparison.configurations):
        batch = comparison.copies(number, n_each)
        first, until = sample_detours(batch.arm, rng, n_each, LONGEST_WAIT)
        until[0] = 0.0
        last = configurations[rng.integers(len(configurations), size=n_each)]
        run_to_end(batch, _detours(batch.arm, first, until, last), features=False)
        runs = batch.runs()
        untouched = np.where(runs.touched_at_rest, np.inf, runs.seconds)
        costs = untouched, runs.stopped_s + 1e-3 * runs.seconds
        for best, cost in zip(found.values(), costs, strict=True):
            least = np.argmin(np.where(runs.arrived, cost, np.inf), keepdims=True)
            best.append(selected(runs, least))
    return {name: joined(best) for name, best in found.items()}


def _detours(arm: Arm, first: Vec, until: Vec, last: Vec) -> Acts:
    """Return actions to first configurations until some times [s], then to the last ones."""
    cycle = count()

    def acts(batch: ReachBatch) -> NDArray[np.float32]:
        early = next(cycle) * arm.dt < until
        return toward(arm, batch.state.q, np.where(early[:, None], first, last))

    return acts
