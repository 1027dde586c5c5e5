"""Rollout policy improvement for reaching (compiled).

At each decision the policy is simulated forward from the present state (``rollout.py``),
beside people whose motion is predicted by ``prediction.py``. If that rollout collides, other
action sequences (``candidates.py``) are simulated: fixed ones first, evasions and sampled
waypoints only where all before collide. The best sequence is executed for one control period
(receding horizon); its remainder is a candidate of the next decision (warm start). An action is
held for ``STEP_S``, as in the simulation, so that a remainder ends as it was simulated.

Later in an episode candidates are also simulated where the policy's rollout neither succeeds
nor collides, since the policy may wait longer than necessary; then only a candidate that
succeeds is selected. Most sampled waypoints perturb the incumbent, the sample that came nearest
to the goal so far, so that samples improve from decision to decision.

Under a speed and separation constraint candidates are simulated wherever the policy does not
succeed soon, and the one that succeeds soonest is selected: mostly a sampled waypoint that
leaves a person's path in time and returns as the person passes.

Predictions carry no guarantee; speed and separation monitoring (``ssm.py``) does.

Source: Tesauro and Galperin, *On-line policy improvement using Monte-Carlo search* (1996);
Bertsekas et al., *Rollout algorithms for combinatorial optimization* (1997). Deviates: one
predicted motion instead of samples; candidates only where the policy's rollout fails.
"""

import math

import numpy as np
from numpy.typing import NDArray

from app.sim.core.jit import kernel
from app.sim.core.kernels import rng as random
from app.sim.geometry.capsules import copy_values
from app.sim.prediction.kernels.networks import STEP_S, Floats
from app.sim.reach.kernels.episode import ReachCell
from app.sim.reach.rollout.kernels.candidates import (
    N_DETERMINISTIC,
    N_FIXED,
    N_SAMPLES,
    N_SAMPLES_SSM,
    PERTURBED_SHARE,
    POLICY,
    SAMPLE,
    CandidateSequence,
    candidate_of,
    perturb_waypoint,
    sample_waypoint,
)
from app.sim.reach.rollout.kernels.prediction import N_LONG_MOMENTS, N_MOMENTS, predict_people
from app.sim.reach.rollout.kernels.rollout import (
    SSM_TIME_COST,
    SUCCESS_SCORE,
    Beginning,
    apply_ssm_constraint,
    periods_of,
    simulate_candidate,
)
from app.sim.reach.rollout.kernels.workspace import DISTANCE, RolloutWorkspace
from app.sim.robot.kernels.actions import ActionRule
from app.sim.scenario.kernels.episode import COLLISION, RUNNING, EpisodeState

NO_COLLISION = -1.0
"""Scores above this are those of rollouts without a collision."""
BETTER = 0.02
"""Least improvement over the best score so far."""
SUCCEEDS = 1.0
"""Scores above this are those of rollouts that reach the goal."""
STALL_TIME = 1.0
"""Elapsed time after which a policy without success or collision counts as stalled [s]."""
DEADLINE_TIME = 4.0
"""Time left below which it counts as stalled, too [s]."""
SOON = 1.5
"""Under a constraint no candidate is simulated after one that succeeds within this time [s]."""
WARM_START_MARGIN = 0.5
"""Share of the prediction margin that applies to the warm start."""
OWN, WARM_START, FIRST_CANDIDATE = 0, 1, 2
"""Order of a decision: the policy's own action, the remainder of the previous plan, candidates
by their numbers."""
FIRST_EVASION, FIRST_SAMPLE = FIRST_CANDIDATE + N_FIXED, FIRST_CANDIDATE + N_DETERMINISTIC
END = FIRST_SAMPLE + N_SAMPLES_SSM
"""Position after the last candidate."""


@kernel()
def remaining_plan(e: int, work: RolloutWorkspace, dt: float) -> CandidateSequence:
    """Return the remainder of the previous plan of an environment, or POLICY."""
    k = work.plan[e, 0]
    candidate = candidate_of(k)
    work.plan[e, 1] += 1
    done = work.plan[e, 1] // periods_of(dt)
    if k == POLICY or candidate.steps <= done:
        return candidate_of(POLICY)
    if candidate.kind == SAMPLE:
        copy_values(work.plan_waypoint[e], work.waypoint)
        return CandidateSequence(SAMPLE, max(0, work.plan_steps[e] - done))
    return CandidateSequence(candidate.kind, candidate.steps - done)


@kernel(inline="always")
def _sample(
    world: ReachCell, state: EpisodeState, e: int, k: int, work: RolloutWorkspace
) -> int:
    """Fill ``work.waypoint`` with sample ``k`` of a decision; return its duration [steps].

    The first one is the incumbent, for what remains of its duration.
    """
    info = work.incumbent_info[e]
    if k == 0:
        random.start_stream(0, 0, work.n_sampled[e], work.rng)
        work.n_sampled[e] += 1
        if info[0] > 0.0:
            info[1] = max(0.0, info[1] - (state.elapsed[e] - info[2]) / STEP_S)
            info[2] = state.elapsed[e]
            copy_values(work.incumbent[e], work.waypoint)
            return int(info[1])
    if info[0] > 0.0 and random.uniform(work.rng) < PERTURBED_SHARE:
        return perturb_waypoint(
            world.arm, work.incumbent[e], int(info[1]), work.rng, work.waypoint
        )
    return sample_waypoint(world.arm, state.q[e], work.rng, work.waypoint)


@kernel(inline="always")
def _update_incumbent(
    state: EpisodeState, e: int, k: int, steps: int, score: float, work: RolloutWorkspace
) -> None:
    """Store sample ``k`` of a decision, just simulated, if its shortfall is less."""
    info, shortfall = work.incumbent_info[e], work.closest[0]
    if work.ssm_distance[0] > 0.0:
        shortfall = SUCCESS_SCORE - score
    if k == 0 or info[0] == 0.0 or shortfall < info[0]:
        info[0], info[1], info[2] = shortfall, steps, state.elapsed[e]
        copy_values(work.waypoint, work.incumbent[e])


@kernel(inline="always")
def _candidate_at(
    world: ReachCell, state: EpisodeState, e: int, k: int, work: RolloutWorkspace
) -> CandidateSequence:
    """Return the candidate at position ``k`` of a decision."""
    if k == WARM_START:
        return remaining_plan(e, work, world.arm.dt)
    if k >= FIRST_SAMPLE:
        return CandidateSequence(SAMPLE, _sample(world, state, e, k - FIRST_SAMPLE, work))
    return candidate_of(POLICY if k == OWN else k - FIRST_CANDIDATE)


@kernel()
def _score_threshold(state: EpisodeState, e: int, outcome: int, score: float) -> float:
    """Return the score that candidates must exceed; infinity if none is simulated.

    Args:
        e: Environment.
        outcome: Outcome of the better one of policy and warm start.
    """
    if outcome == COLLISION:
        return score + BETTER
    stalled = state.elapsed[e] >= STALL_TIME or state.time_left[e] <= DEADLINE_TIME
    return SUCCEEDS if outcome == RUNNING and stalled else math.inf


@kernel()
def _next(k: int, threshold: float, selected: bool) -> int:
    """Return the position of the candidate to simulate after position ``k``; END for none.

    Args:
        k: Position.
        threshold: Score that candidates must exceed.
        selected: Whether a candidate is selected already.
    """
    k += 1
    if threshold == math.inf or k == FIRST_SAMPLE + N_SAMPLES:
        return END
    if k == FIRST_EVASION and threshold > NO_COLLISION:
        k = FIRST_SAMPLE
    if k == FIRST_SAMPLE and threshold > NO_COLLISION and selected:
        return END
    return k


@kernel()
def _next_constrained(k: int, threshold: float) -> int:
    """Return the same as :func:`_next` under a constraint, with evasions last."""
    k += 1
    if threshold > SUCCESS_SCORE - SSM_TIME_COST * SOON or k == FIRST_SAMPLE:
        return END
    if k == FIRST_EVASION:
        return FIRST_SAMPLE
    if k == END:
        return END if threshold > NO_COLLISION else FIRST_EVASION
    return k


@kernel(inline="always")
def _select(e: int, k: int, steps: int, work: RolloutWorkspace) -> int:
    """Store the candidate at position ``k`` as the best so far; return its number."""
    if k == OWN:
        return POLICY
    if k == WARM_START:
        return int(work.plan[e, 0])
    work.plan[e, 1] = 0
    if k < FIRST_SAMPLE:
        return k - FIRST_CANDIDATE
    copy_values(work.waypoint, work.plan_waypoint[e])
    work.plan_steps[e] = steps
    return N_DETERMINISTIC


@kernel(inline="always")
def _improve(
    world: ReachCell, rule: ActionRule, state: EpisodeState, e: int, work: RolloutWorkspace
) -> int:
    """Select a candidate for an environment; return its number, or POLICY.

    One loop with one call of :func:`simulate_candidate`, because numba would compile each call
    separately, for half a minute.

    Args:
        rule: Action type and bounds.
        e: Environment.
        work: Work space; ``best_act`` holds the policy's action, then that of the selection.
    """
    k, chosen, selected, outcome, threshold = OWN, POLICY, False, RUNNING, -math.inf
    while k < END:
        candidate = _candidate_at(world, state, e, k, work)
        if k != WARM_START or candidate.kind != POLICY:
            beginning = Beginning(0, 1.0)
            if k == WARM_START:
                elapsed = work.plan[e, 1] % periods_of(world.arm.dt)
                beginning = Beginning(elapsed, WARM_START_MARGIN)
            end, score = simulate_candidate(world, rule, state, e, candidate, beginning, work)
            if k >= FIRST_SAMPLE:
                _update_incumbent(state, e, k - FIRST_SAMPLE, candidate.steps, score, work)
            if score > threshold:
                copy_values(work.first_act, work.best_act)
                chosen = _select(e, k, candidate.steps, work)
                selected = k >= FIRST_CANDIDATE
                outcome, threshold = end, score + BETTER if selected else score
        if work.ssm_distance[0] > 0.0:
            k = _next_constrained(k, threshold)
            continue
        if k == WARM_START:
            threshold = _score_threshold(state, e, outcome, threshold)
        k = _next(k, threshold, selected)
    work.plan[e, 0] = chosen
    copy_values(work.best_act, work.last_act[e])
    return chosen


@kernel(nogil=True)
def improve_batch(
    world: ReachCell,
    rule: ActionRule,
    state: EpisodeState,
    act: Floats,
    work: RolloutWorkspace,
    chosen: NDArray[np.int64],
) -> None:
    """Improve the actions of all environments whose episode is running.

    Args:
        rule: Action type and bounds.
        act: Actions of the policy, shape (n_envs, 6); replaced where a candidate is better.
        work: Policy and work space.
        chosen: Filled with the number of the candidate selected, or POLICY, shape (n_envs,).
    """
    for e in range(state.q.shape[0]):
        chosen[e] = POLICY
        if state.outcome[e] != RUNNING:
            continue
        if state.elapsed[e] == 0.0:
            work.plan[e, 0] = POLICY
            work.n_sampled[e], work.incumbent_info[e, 0] = 0, 0.0
        constrained = work.ssm[DISTANCE] > 0.0
        moments = N_LONG_MOMENTS if constrained else N_MOMENTS
        predict_people(world, state, e, moments, work.observation, work.people)
        work.ssm_distance[0] = 0.0
        if constrained:
            apply_ssm_constraint(world, state, e, work)
        copy_values(act[e], work.best_act)
        chosen[e] = _improve(world, rule, state, e, work)
        if chosen[e] != POLICY:
            copy_values(work.best_act, act[e])
