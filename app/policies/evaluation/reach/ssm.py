"""Protocol ``reach-ssm``: a policy and planners under one safety layer (docs/method.md 2.6).

A person crosses between the robot at home and its goal (``app/sim/reach/crossings.py``: 200
crossings fixed before any tuning, and as many recorded crossings as are given). All rows have
the joint limits of the cell, within which the policy must have been trained, and the same speed
and separation monitoring, with the protective distance of the thesis' comparison.

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
    Planned once around people at their start positions, as in the thesis.
``rrtconnect-blocked``, ``aorrtc-blocked``
    Replanned when the path is blocked.
``replan-every-cycle``
    Replanned in every control period, in 20 ms of wall time.
``policy-no-person``, ``planner-no-person``
    The person stands aside: unhindered times.
``planner-no-ssm``
    A path planned without people and followed without the safety layer: contact rate.
``oracle``, ``oracle-least-stopped``
    Of 128 scripted resimulations of each crossing, the fastest without contact, and the one
    with the shortest stops: bounds with the person's motion known.

In rows ending in ``-directed`` the layer uses measured velocities; in all others people are
assumed to approach at 1.6 m/s from any position. ``-recorded`` rows use recorded crossings.

``time_s`` is the time to the goal of runs that arrive; ``time_capped_s`` covers all runs, with
the time limit for those that do not arrive. People do not yield and may walk into a stopped
robot: such a run is counted in ``contacts_at_rest`` and continues after they have passed;
``time_untouched_s`` excludes it. Contact with a moving link ends the run. ``below_half_s``
includes the time with override 0, ``stopped_s``; ``standstill_stopped_s`` excludes braking.
Planners, like policies, arrive when the TCP is within 0.1 m of the goal.

``random`` are random goals beside pedestrians (docs/method.md 2.1) for at most RANDOM_S with
the policy under each layer; ``random-still`` is the same with a robot that stays at home. Both
count contacts with a moving and with a stationary robot; here either ends the episode.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from app.policies.checkpoints import pretrained
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.trained_cell import cell_of
from app.policies.evaluation.reach.episodes import N_ENVS, random_goals
from app.policies.evaluation.reach.ssm_crossings import (
    DEFAULT_SETTINGS,
    MARGIN,
    Comparison,
    CrossingRuns,
    run_monitored,
)
from app.policies.evaluation.reach.ssm_rows import (
    against,
    arrival_times,
    crossing_row,
    random_row,
)
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.inference.controllers import Controller, RolloutController, controller_of
from app.policies.inference.reach_policy import ReachPolicy
from app.policies.inference.rollout import NO_CONSTRAINT, can_roll_out, ssm_constraint_of
from app.sim.cells.cell import Cell
from app.sim.reach.batch import ReachSettings
from app.sim.reach.crossings import N_CROSSINGS, SEED, crossings, recorded_crossings
from app.sim.reach.monitored.batch import HORIZON_S, MonitoredReachBatch
from app.sim.reach.oracle_search import Acts
from app.sim.safety.layer import SafetySettings, safety_settings
from app.sim.scenario.kernels.episode import TIMEOUT
from app.sim.scenario.monitoring import MonitoredEpisodes, joined, selected

WITH_ROLLOUT = "policy-rollout"
"""Row of the policy with rollout."""
DIRECTED = "-directed"
"""Suffix of rows in which the safety layer uses measured velocities."""
SETTINGS = DEFAULT_SETTINGS
RANDOM_EPISODES = 10_000
RANDOM_S = 25.0
"""Time limit of a random episode [s], the longer one of docs/method.md 2.6."""
N_RECORDED = 60
"""Number of recorded crossings."""


def controllers_by_row(
    checkpoint: Checkpoint, actor: ReachPolicy, safety: SafetySettings, dt: float
) -> dict[str, Controller]:
    """Return the controllers of policies by row."""
    direct, layer = controller_of(actor, "direct"), ssm_constraint_of(safety, dt)
    controllers = {"policy": direct}
    if can_roll_out(actor):
        controllers[WITH_ROLLOUT] = RolloutController(direct, actor, layer)
        if layer != NO_CONSTRAINT:
            controllers["policy-rollout-ssm-agnostic"] = RolloutController(direct, actor)
    if checkpoint.manifest["preset"].get("episode", {}).get("safety") == "ssm":
        other = ReachPolicy(pretrained.load("reach"))
        if (other.action, other.view) == (actor.action, actor.view):
            controllers["policy-trained-without-ssm"] = controller_of(other, "direct")
    return controllers


def compare(
    comparison: Comparison, controllers: Mapping[str, Controller], rows: list[Json], suffix: str
) -> dict[str, CrossingRuns]:
    """Run policies, planners and the oracle over a set of crossings; add and return rows."""
    found = {}
    for name, runs in comparison.run(controllers):
        found[name] = runs
        limit = comparison.settings.time_limit_s
        rows.append(crossing_row(name + suffix, runs.episodes, limit))
    return found


def random_episodes(
    cell: Cell, batch: MonitoredReachBatch, acts: Acts, n: int, seed: int
) -> MonitoredEpisodes:
    """Run ``n`` episodes of ``reach-random`` under the safety layer."""
    goals, found = random_goals(cell, n, seed), []
    for number, first in enumerate(range(0, n, N_ENVS)):
        some = goals[first : first + N_ENVS]
        batch.state.episode[:] = number
        batch.restart()
        batch.set_goals(np.arange(len(some)), some)
        batch.state.outcome[len(some) :] = TIMEOUT
        runs = run_monitored(batch, acts).episodes
        found.append(selected(runs, np.arange(len(some))))
    return joined(found)


def run_ssm(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Compare a policy with planners under the safety layer.

    The request has the number of random episodes, by default 10,000; that of the crossings is
    200, or the same if that is less. Recorded motion gives a second set of crossings.
    """
    n_random = request.episodes or RANDOM_EPISODES
    actor, cell = ReachPolicy(checkpoint), cell_of(checkpoint.manifest)
    reach = ReachSettings(action=actor.action, observation=actor.view)
    n = min(N_CROSSINGS, n_random)
    sets = {"": crossings(cell, n)}
    if request.motions:
        sets["-recorded"] = recorded_crossings(cell, request.motions, min(N_RECORDED, n_random))
    assumed = safety_settings(cell)
    layers = {"": assumed, DIRECTED: replace(assumed, use_measured_velocity=True)}
    controllers = {
        end: controllers_by_row(checkpoint, actor, safety, cell.robot.dt)
        for end, safety in layers.items()
    }
    each = sum(len(SETTINGS.planners) + len(some) + 5 for some in controllers.values())
    rows = request.rows(len(sets) * each + 3)
    result: Json = {"paired": {}, "seconds": {}, "example": {}}
    for name, crossed in sets.items():
        for end, safety in layers.items():
            comparison = Comparison(cell, crossed, reach, safety, request.seed, SETTINGS)
            found = compare(comparison, controllers[end], rows, name + end)
            result["paired"] |= paired(found, list(controllers[end]), name + end)
            if not name:
                layer = "directed" if end else "worst-case"
                result["seconds"][layer] = {
                    row: arrival_times(runs.episodes) for row, runs in found.items()
                }
                result["example"][layer] = example_of(found, cell.robot.dt)
    policy = controllers[""]["policy"]
    trials: dict[str, tuple[Acts, SafetySettings]] = {
        "random": (policy.acts, layers[""]),
        "random-still": (lambda batch: np.zeros((batch.n_envs, 6), np.float32), layers[""]),
        "random" + DIRECTED: (policy.acts, layers[DIRECTED]),
    }
    longer = replace(reach, time_limit_s=RANDOM_S)
    for name, (acts, safety) in trials.items():
        batch = MonitoredReachBatch(cell, N_ENVS, request.seed, longer, safety)
        runs = random_episodes(cell, batch, acts, n_random, request.seed)
        rows.append(random_row(name, runs))
    return {
        "episodes": n_random,
        "settings": stated(assumed, n, [motion.source for motion in request.motions]),
        "results": rows,
        **result,
    }


def paired(found: Mapping[str, CrossingRuns], policies: Sequence[str], end: str) -> Json:
    """Return the time saved by each policy against each planner, by names of rows."""
    return {
        f"{policy}{end} against {name}{end}": against(
            found[policy].episodes, found[name].episodes, SETTINGS.time_limit_s
        )
        for policy in policies
        for name in SETTINGS.planners
    }


def example_of(found: Mapping[str, CrossingRuns], dt: float) -> Json:
    """Return the overrides over time in the crossing with the median saving of time."""
    one = found[WITH_ROLLOUT if WITH_ROLLOUT in found else "policy"].episodes
    other = found["rrtstar-once"].episodes
    both = np.flatnonzero(one.arrived & other.arrived)
    if len(both) == 0:
        return {}
    saving = (other.seconds - one.seconds)[both]
    number = int(both[np.argsort(saving, kind="stable")[len(both) // 2]])
    return {
        "crossing": number,
        "dt_s": dt,
        "override": {
            name: np.round(runs.overrides[number], 4).tolist()
            for name, runs in found.items()
            if runs.overrides
        },
    }


def stated(safety: SafetySettings, n: int, sources: Sequence[str]) -> Json:
    """Return the settings stated with the result."""
    return {
        "crossings": n,
        "crossings_seed": SEED,
        "cap_s": SETTINGS.time_limit_s,
        "max_time_left_s": HORIZON_S,
        "random_s": RANDOM_S,
        "planner_margin_m": MARGIN,
        "safety": safety.describe(),
        "directed": replace(safety, use_measured_velocity=True).describe(),
        "motions": list(sources),
    }
