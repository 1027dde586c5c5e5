"""Protocol ``reach-ssm``: a policy and planners under the same safety layer (METHOD 2.6).

A person crosses between the robot at home and its goal (``app/sim/reach/crossings.py``: 200
crossings
fixed before anything was tuned on them, and as many from recordings as are given). Everybody
has the same joint limits and the same speed and separation monitoring, with the protective
distance of the source's comparison.

``policy``
    The checkpoint, queried every 20 ms.
``policy-rollout``
    The same with rollout checks (``app/policies/inference/rollout.py``) for contacts with
    people, cell and itself; under measured velocities also for stops by the safety layer.
``policy-rollout-ssm-agnostic``
    The rollout under measured velocities without a model of the safety layer.
``policy-trained-without-ssm``
    The shipped policy trained without the layer, if the checkpoint was trained under it.
``rrtstar-once``
    Planned once around people at their start positions, as in the source.
``rrtconnect-blocked``, ``aorrtc-blocked``
    Replanned when the path is blocked.
``replan-every-cycle``
    Replanned in every control period, in 20 ms of wall time.
``policy-no-person``, ``planner-no-person``
    The person stands aside (ASIDE): unhindered times.
``planner-no-ssm``
    A path planned without people and followed without the safety layer: contact rate.
``oracle``, ``oracle-least-stopped``
    Of N_HINDSIGHT scripted resimulations of each crossing, the fastest without contact, and
    the one with the shortest stops: bounds with the person's motion known.

In rows ending in ``-directed`` the layer uses measured velocities; in all others people are
assumed to approach at 1.6 m/s from any position. ``-recorded`` rows use recorded crossings.

The time to the goal is that of the runs which arrive; ``time_capped_s`` is over all runs and
counts those not there in CAP_S as CAP_S. People give way to nothing, so they may walk into a
robot that the layer holds: such a run is counted (``contacts_at_rest``), and goes on once they
have passed; ``time_untouched_s`` leaves it out. A link touched in motion ends the run.
``below_half_s`` includes the time at 0, ``stopped_s``; ``held_s`` is the part of that in which
the robot is at rest: a stop may be begun and not ended. Planners arrive, like policies, once
the tcp is within 0.1 m of the goal.

``random`` is another trial: random goals and people who walk about (METHOD 2.1) for RANDOM_S,
with the policy under either layer, and ``random-still`` the same beside a robot that stays at
home: contacts, apart by whether the robot moved.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.policies.checkpoints import pretrained
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.trained_cell import cell_of
from app.policies.evaluation.reach.episodes import N_ENVS, random_goals
from app.policies.evaluation.rows import OnRow, ignore_row
from app.policies.evaluation.statistics import mean_of, wilson
from app.policies.inference.controllers import Controller, RolloutController, controller_of
from app.policies.inference.reach_policy import ReachPolicy
from app.policies.inference.rollout import NO_CONSTRAINT, can_roll_out, ssm_constraint_of
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.mocap.importer import Motion
from app.sim.planning.ompl_planners import PlanSettings
from app.sim.planning.replanning import ReplanningSettings
from app.sim.reach.batch import ReachBatch, ReachSettings, goal_region_of
from app.sim.reach.crossings import (
    N_CROSSINGS,
    SEED,
    CrossingSet,
    crossings,
    recorded_crossings,
)
from app.sim.reach.monitored.batch import (
    HORIZON_S,
    MonitoredEpisodes,
    MonitoredReachBatch,
    MonitoringSettings,
)
from app.sim.reach.monitored.planners import drive_planner, postures_of
from app.sim.reach.oracle_search import sample_detours, toward
from app.sim.robot.actions import ActionSettings
from app.sim.safety.layer import SafetySettings, safety_settings
from app.sim.scenario.kernels.episode import RUNNING, TIMEOUT
from app.sim.scene.scene import arm_of

Json = dict[str, Any]
AHEAD = "policy-rollout"
"""Row of the policy where it looks ahead."""
DIRECTED = "-directed"
"""Suffix of rows in which the safety layer uses measured velocities."""
CAP_S = 20.0
"""Longest run of a crossing [s]."""
RANDOM_EPISODES = 10_000
RANDOM_S = 25.0
"""Longest random episode [s], the longer one of METHOD 2.6."""
N_RECORDED = 60
"""Crossings made from recordings."""
N_HINDSIGHT = 128
"""Scripted replays of each crossing."""
LONGEST_WAIT = 8.0
"""Latest moment at which one of them turns to its goal [s]."""
MARGIN = 0.05
"""Distance to people that planners keep [m]: of 0.05 and 0.35 the one with which RRT* and
RRT-Connect arrived sooner, on 20 crossings of another seed (77)."""
ASIDE = (-2.0, 2.0, 0.2)
"""x, y, radius of who stands aside where nobody shall be near [m]: far corner of the walking
area of METHOD 2.1, not an empty cell, for policies need not have met one in training."""
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
ALONE = ReplanningSettings(
    role="plan-once", plan=PlanSettings(planner="rrt-star", budget_s=0.2)
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """Runs of one row, and how the override went in each."""

    runs: MonitoredEpisodes
    """What happened."""
    overrides: list[Vec]
    """Override of every period of each run, in [0, 1]."""


def course_row(name: str, runs: MonitoredEpisodes) -> Json:
    """Return the row of some runs; see the head of this file."""
    n, arrived = len(runs.arrived), runs.arrived
    capped = np.where(arrived, runs.seconds, CAP_S)
    return {
        "name": name,
        "n": n,
        "arrived": wilson(int(arrived.sum()), n),
        "time_s": _spread(runs.seconds[arrived]),
        "time_capped_s": _spread(capped),
        "time_untouched_s": _spread(runs.seconds[arrived & ~runs.touched_at_rest]),
        "below_half_s": _spread(runs.below_half_s),
        "stopped_s": _spread(runs.stopped_s),
        "standing_s": _spread(runs.standstill_s),
        "held_s": _spread(runs.standstill_stopped_s),
        "never_stopped": wilson(int((runs.stopped_s == 0.0).sum()), n),
        "never_held": wilson(int((runs.standstill_stopped_s == 0.0).sum()), n),
        "joint_way_rad": _spread(runs.joint_path[arrived]),
        "tool_way_m": _spread(runs.tool_path[arrived]),
        **contacts_of(runs),
    }


def contacts_of(runs: MonitoredEpisodes) -> Json:
    """Return the contacts of some runs, apart by whether the robot moved."""
    return {
        "contacts": int((runs.touched_moving | runs.touched_at_rest).sum()),
        "contacts_moving": int(runs.touched_moving.sum()),
        "contacts_at_rest": int(runs.touched_at_rest.sum()),
        "contacts_cell": int(runs.touched_cell.sum()),
        "fastest_link_m_s": float(runs.link_speed[runs.touched_moving].max(initial=0.0)),
        "fastest_person_m_s": float(runs.person_speed.max(initial=0.0)),
    }


def _spread(values: NDArray[np.floating]) -> dict[str, float] | None:
    """Return mean, standard deviation and 95 % interval; None without values."""
    found = mean_of(values)
    if found is None:
        return None
    return {**found, "sd": float(values.std(ddof=1)) if len(values) > 1 else 0.0}


def against(one: MonitoredEpisodes, other: MonitoredEpisodes) -> Json:
    """Return how much sooner ``one`` arrives than ``other``, run by run.

    ``all``: over all runs, those that do not arrive counted as CAP_S; ``untouched``: over those
    in which both arrive and neither is touched. ``share`` is the saving as a share of the
    other's mean time.
    """
    untouched = one.arrived & other.arrived & ~one.touched_at_rest & ~other.touched_at_rest
    times = [np.where(runs.arrived, runs.seconds, CAP_S) for runs in (one, other)]

    def saving(which: NDArray[np.bool_]) -> Json | None:
        if not which.any():
            return None
        less = mean_of(times[1][which] - times[0][which])
        scale = float(times[1][which].mean())
        share = {key: value / scale for key, value in (less or {}).items()}
        return {"n": int(which.sum()), "saved_s": less, "share": share}

    every = np.ones(len(untouched), dtype=np.bool_)
    return {"all": saving(every), "untouched": saving(untouched)}


def drive(batch: MonitoredReachBatch, controller: Controller) -> Course:
    """Run a batch that was just reset to the end of every row's episode."""
    found: list[Vec] = []
    while (batch.state.outcome == RUNNING).any():
        batch.step(controller.acts(batch), auto_reset=False, features=False)
        found.append(batch.override.copy())
    runs, every = batch.runs(), np.array(found)
    periods = np.round(runs.seconds / batch.arm.dt).astype(int)
    return Course(runs=runs, overrides=[every[:n, k] for k, n in enumerate(periods)])


class Comparison:
    """Runs everybody over one set of crossings.

    Args:
        cell: Work cell.
        crossed: The crossings.
        settings: What the policy's batch needs: its action and view; time limit and people are
            set here.
        safety: What the safety layer assumes.
        seed: Seed of the planners.
    """

    def __init__(
        self,
        cell: Cell,
        crossed: CrossingSet,
        settings: ReachSettings,
        safety: SafetySettings,
        seed: int,
    ) -> None:
        self.cell, self.crossed, self.safety, self.seed = cell, crossed, safety, seed
        self._settings = replace(
            settings, people=("walker",), time_limit_s=CAP_S, start="uniform"
        )
        self._postures: list[Vec] | None = None

    def batch(self, *, alone: bool = False, guarded: bool = True) -> MonitoredReachBatch:
        """Return a batch at the start of all crossings.

        Args:
            alone: Whether the person stands aside, out of everybody's way.
            guarded: Whether the safety layer acts.
        """
        n = len(self.crossed.goals)
        aside = np.tile(np.array(ASIDE), (n, 2, 1))
        batch = MonitoredReachBatch(
            self.cell,
            n,
            self.seed,
            self._settings,
            self.safety,
            MonitoringSettings(active=guarded, rest_ends=False),
            tracks=aside if alone else self.crossed.tracks,
        )
        batch.reset()
        batch.set_goals(np.arange(n), self.crossed.goals)
        return batch

    def copies(self, number: int, n: int) -> MonitoredReachBatch:
        """Return a batch of ``n`` rows at the start of one crossing; actions mean speeds."""
        one = np.repeat(self.crossed.tracks[number][None], n, axis=0)
        batch = MonitoredReachBatch(
            self.cell,
            n,
            self.seed,
            replace(self._settings, action=ActionSettings()),
            self.safety,
            MonitoringSettings(rest_ends=False),
            tracks=one,
        )
        batch.reset()
        goals = np.repeat(self.crossed.goals[number][None], n, axis=0)
        batch.set_goals(np.arange(n), goals)
        return batch

    def postures(self) -> list[Vec]:
        """Return the postures at each goal that planners and replays choose among."""
        if self._postures is None:
            self._postures = postures_of(arm_of(self.cell), self.crossed.goals, self.seed)
        return self._postures

    def policy(self, controller: Controller, *, alone: bool = False) -> Course:
        """Run a policy over all crossings."""
        return drive(self.batch(alone=alone), controller)

    def planner(
        self,
        settings: ReplanningSettings,
        *,
        alone: bool = False,
        blind: bool = False,
        guarded: bool = True,
    ) -> Course:
        """Run a planner over all crossings."""
        batch = self.batch(alone=alone, guarded=guarded)
        overrides, _ = drive_planner(
            batch, self.postures(), settings, self.seed + 1, blind=blind
        )
        return Course(runs=batch.runs(), overrides=overrides)


def best_replays(
    comparison: Comparison, n_each: int, rng: np.random.Generator
) -> dict[str, MonitoredEpisodes]:
    """Return the best replays of each crossing under the safety layer, by row.

    Where no replay is both untouched and there in time, the first one stands for all; the one
    held least need only be there in time.

    Args:
        comparison: Crossings.
        n_each: Resimulations of each.
        rng: Draws them.
    """
    postures, soonest, freest = comparison.postures(), [], []
    for number, some in enumerate(postures):
        batch = comparison.copies(number, n_each)
        first, until = sample_detours(batch.arm, rng, n_each, LONGEST_WAIT)
        until[0] = 0.0
        last = some[rng.integers(len(some), size=n_each)]
        k = 0
        while (batch.state.outcome == RUNNING).any():
            aim = np.where((k * batch.arm.dt < until)[:, None], first, last)
            batch.step(toward(batch.arm, batch.state.q, aim), auto_reset=False, features=False)
            k += 1
        runs = batch.runs()
        good = runs.arrived & ~runs.touched_at_rest
        soonest.append(_least(runs, np.where(good, runs.seconds, np.inf)))
        held = runs.stopped_s + 1e-3 * runs.seconds
        freest.append(_least(runs, np.where(runs.arrived, held, np.inf)))
    return {"oracle": joined(soonest), "oracle-least-stopped": joined(freest)}


def _least(runs: MonitoredEpisodes, cost: Vec) -> MonitoredEpisodes:
    """Return the run that costs least."""
    return picked(runs, np.argmin(cost, keepdims=True))


def random_runs(
    cell: Cell,
    settings: ReachSettings,
    safety: SafetySettings,
    controller: Controller,
    n: int,
    seed: int,
) -> list[MonitoredEpisodes]:
    """Run the episodes of ``reach-random`` under the safety layer."""
    settings = replace(settings, time_limit_s=RANDOM_S)
    batch = MonitoredReachBatch(cell, N_ENVS, seed, settings, safety)
    goals, found = random_goals(*goal_box(cell), n, seed), []
    for number, first in enumerate(range(0, n, N_ENVS)):
        some = goals[first : first + N_ENVS]
        batch.state.episode[:] = number
        batch.restart()
        batch.set_goals(np.arange(len(some)), some)
        batch.state.outcome[len(some) :] = TIMEOUT  # nobody asks about these rows
        runs = drive(batch, controller).runs
        found.append(picked(runs, np.arange(len(some))))
    return found


def goal_box(cell: Cell) -> tuple[Vec, Vec]:
    """Return the lower and the upper corner of a cell's goal box [m], shape (3,) each."""
    region = goal_region_of(cell)
    middle, half = np.array(region.center), 0.5 * np.array(region.size)
    return middle - half, middle + half


def random_row(name: str, parts: Sequence[MonitoredEpisodes]) -> Json:
    """Return the row of random episodes."""
    runs = joined(parts)
    n = len(runs.arrived)
    touched = runs.touched_moving | runs.touched_at_rest | runs.touched_cell
    return {
        "name": name,
        "n": n,
        "success": wilson(int(runs.arrived.sum()), n),
        "contact": wilson(int(touched.sum()), n),
        "moving_rate": wilson(int(runs.touched_moving.sum()), n),
        "timeout": wilson(int((~runs.arrived & ~touched).sum()), n),
        "time_s": _spread(runs.seconds[runs.arrived]),
        **contacts_of(runs),
    }


def joined(parts: Sequence[MonitoredEpisodes]) -> MonitoredEpisodes:
    """Return several sets of runs as one."""
    names = MonitoredEpisodes.__dataclass_fields__
    values: Any = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in names
    }
    return MonitoredEpisodes(**values)


def picked(runs: MonitoredEpisodes, which: NDArray[np.int64]) -> MonitoredEpisodes:
    """Return some of some runs."""
    names = MonitoredEpisodes.__dataclass_fields__
    values: Any = {name: getattr(runs, name)[which] for name in names}
    return MonitoredEpisodes(**values)


class _Still:
    """Stays where it is."""

    def acts(self, batch: ReachBatch) -> NDArray[np.float32]:
        """Return actions of no speed."""
        return np.zeros((batch.n_envs, 6), dtype=np.float32)


def example_of(courses: Mapping[str, Course], dt: float) -> Json:
    """Return how the override went in one crossing: that of the median saving of time."""
    one = courses[AHEAD if AHEAD in courses else "policy"].runs
    other = courses["rrtstar-once"].runs
    both = np.flatnonzero(one.arrived & other.arrived)
    if len(both) == 0:
        return {}
    saving = (other.seconds - one.seconds)[both]
    number = int(both[np.argsort(saving, kind="stable")[len(both) // 2]])
    return {
        "crossing": number,
        "dt_s": dt,
        "override": {
            name: np.round(course.overrides[number], 4).tolist()
            for name, course in courses.items()
            if course.overrides
        },
    }


def movers_of(
    checkpoint: Checkpoint, actor: ReachPolicy, safety: SafetySettings, dt: float
) -> dict[str, Controller]:
    """Return who stands in for the policy, by row; see the head of this file."""
    direct, layer = controller_of(actor, "direct"), ssm_constraint_of(safety, dt)
    controllers = {"policy": direct}
    if can_roll_out(actor):
        controllers[AHEAD] = RolloutController(direct, actor, layer)
        if layer != NO_CONSTRAINT:
            controllers["policy-rollout-ssm-agnostic"] = RolloutController(direct, actor)
    if checkpoint.manifest["preset"].get("episode", {}).get("safety") == "ssm":
        other = ReachPolicy(pretrained.load("reach"))
        if (other.action, other.view) == (actor.action, actor.view):
            controllers["policy-trained-without-ssm"] = controller_of(other, "direct")
    return controllers


class _Rows:
    """Collects rows and tells of each."""

    def __init__(self, total: int, on_row: OnRow) -> None:
        self.rows: list[Json] = []
        self._total, self._on_row = total, on_row

    def add(self, row: Json) -> None:
        """Add a row."""
        self.rows.append(row)
        self._on_row(len(self.rows), self._total, row)


def compare(
    comparison: Comparison, controllers: Mapping[str, Controller], rows: _Rows, suffix: str = ""
) -> dict[str, Course]:
    """Run policies and planners over one set of crossings; return their courses by row."""
    jobs: dict[str, Callable[[], Course]] = {
        name: partial(comparison.policy, controller) for name, controller in controllers.items()
    }
    for name, settings in PLANNERS.items():
        jobs[name] = partial(comparison.planner, settings)
    if "policy" in controllers:
        jobs["policy-no-person"] = partial(comparison.policy, controllers["policy"], alone=True)
    jobs["planner-no-person"] = lambda: comparison.planner(ALONE, alone=True)
    jobs["planner-no-ssm"] = lambda: comparison.planner(ALONE, blind=True, guarded=False)
    courses = {}
    for name, job in jobs.items():
        courses[name] = job()
        rows.add(course_row(name + suffix, courses[name].runs))
    best = best_replays(comparison, N_HINDSIGHT, np.random.default_rng(comparison.seed))
    for name, runs in best.items():
        rows.add(course_row(name + suffix, runs))
        courses[name] = Course(runs=runs, overrides=[])
    return courses


def seconds_of(courses: Mapping[str, Course]) -> dict[str, list[float | None]]:
    """Return when each run of each row arrived [s]; None where it did not."""
    return {
        name: [
            round(float(seconds), 2) if arrived else None
            for seconds, arrived in zip(course.runs.seconds, course.runs.arrived, strict=True)
        ]
        for name, course in courses.items()
    }


def run_ssm(
    checkpoint: Checkpoint,
    *,
    episodes: int | None,
    seed: int,
    motions: Sequence[Motion] = (),
    on_row: OnRow = ignore_row,
) -> Json:
    """Compare a policy with planners under the safety layer.

    Args:
        checkpoint: What acts.
        episodes: Number of random episodes, by default 10,000; of crossings there are 200, or
            as many as episodes where that is less.
        seed: Seed of random episodes and planners; the crossings have their own.
        motions: Clean runs of recorded motion for a second set of crossings; none is needed.
        on_row: Told of each row once it is known.
    """
    n_random = episodes or RANDOM_EPISODES
    actor, cell = ReachPolicy(checkpoint), cell_of(checkpoint.manifest)
    settings = ReachSettings(action=actor.action, observation=actor.view)
    n = min(N_CROSSINGS, n_random)
    sets = {"": crossings(cell, n)}
    if motions:
        sets["-recorded"] = recorded_crossings(cell, motions, min(N_RECORDED, n_random))
    assumed = safety_settings(cell)
    layers = {"": assumed, DIRECTED: replace(assumed, use_measured_velocity=True)}
    acting = {
        end: movers_of(checkpoint, actor, safety, cell.robot.dt)
        for end, safety in layers.items()
    }
    each = sum(len(PLANNERS) + len(controllers) + 5 for controllers in acting.values())
    rows = _Rows(len(sets) * each + 3, on_row)
    result: Json = {"paired": {}, "seconds": {}, "example": {}}
    for name, crossed in sets.items():
        for end, safety in layers.items():
            comparison = Comparison(cell, crossed, settings, safety, seed)
            courses = compare(comparison, acting[end], rows, name + end)
            result["paired"] |= paired_of(courses, acting[end], name + end)
            if not name:
                layer = "directed" if end else "worst-case"
                result["seconds"][layer] = seconds_of(courses)
                result["example"][layer] = example_of(courses, cell.robot.dt)
    policy = acting[""]["policy"]
    trials: dict[str, tuple[Controller, SafetySettings]] = {
        "random": (policy, layers[""]),
        "random-still": (_Still(), layers[""]),
        "random" + DIRECTED: (policy, layers[DIRECTED]),
    }
    for name, (controller, safety) in trials.items():
        rows.add(
            random_row(name, random_runs(cell, settings, safety, controller, n_random, seed))
        )
    return {
        "settings": stated(assumed, n, [motion.source for motion in motions]),
        "results": rows.rows,
        **result,
    }


def paired_of(
    courses: Mapping[str, Course], controllers: Mapping[str, Controller], end: str
) -> Json:
    """Return what each controller saves against each planner, by names of rows."""
    return {
        f"{mine}{end} against {name}{end}": against(courses[mine].runs, courses[name].runs)
        for mine in controllers
        for name in PLANNERS
    }


def stated(safety: SafetySettings, n: int, sources: Sequence[str]) -> Json:
    """Return what everybody is given."""
    return {
        "crossings": n,
        "crossings_seed": SEED,
        "cap_s": CAP_S,
        "time_told_s": HORIZON_S,
        "random_s": RANDOM_S,
        "planner_margin_m": MARGIN,
        "safety": safety.describe(),
        "directed": replace(safety, use_measured_velocity=True).describe(),
        "motions": list(sources),
    }
