"""Rollout policy improvement: rollouts match what happens, and collisions become fewer."""

import numpy as np
import pytest

from app.errors import InvalidInput
from app.policies.checkpoints import pretrained
from app.policies.evaluation.reach.episodes import run_episodes, target_goals
from app.policies.inference.controllers import controller_of, inference_modes_of
from app.policies.inference.motion_decision import MotionDecider
from app.policies.inference.reach_policy import ReachPolicy
from app.policies.inference.rollout import CANDIDATES, POLICY, RolloutImprovement, can_roll_out
from app.policies.networks.actor_critic import BASE_WEIGHT
from app.sim.cells.cell import load_cell
from app.sim.core.kernels import rng as random
from app.sim.people.kernels.pedestrian import GAIT, STILL, VX, VY, X, Y
from app.sim.prediction.kernels.networks import STEP_S, Network
from app.sim.prediction.weights import new_motion_predictor
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.kernels.observation_workspace import new_observation_workspace
from app.sim.reach.motion_types import MotionQuery
from app.sim.reach.rollout.kernels import candidates, rollout
from app.sim.reach.rollout.kernels import improvement as kernel
from app.sim.reach.rollout.kernels.prediction import HORIZON_STEPS, N_MOMENTS, predict_people
from app.sim.reach.rollout.kernels.workspace import RolloutWorkspace, new_rollout_workspace
from app.sim.robot.kernels.arm import place_robot
from app.sim.scenario.kernels.episode import COLLISION, RUNNING, SUCCESS
from tests.policies.inference.test_controllers import RandomActor
from tests.policies.untrained import untrained_reach

CELL = load_cell("shared-workspace")
ACTOR = ReachPolicy(pretrained.load("reach"))


def batch_of(n_envs: int, *people: str, seed: int = 3) -> ReachBatch:
    settings = ReachSettings(people=people, observation="forecast", start="clearance")
    batch = ReachBatch(CELL, n_envs, seed, settings)
    batch.reset()
    return batch


def walked(batch: ReachBatch, cycles: int) -> ReachBatch:
    """Let the policy move the robots for some control periods."""
    controller = controller_of(ACTOR, "direct")
    for _ in range(cycles):
        batch.step(controller.acts(batch), auto_reset=False)
    return batch


def workspace(
    batch: ReachBatch, network: Network | None = None, base_weight: float = BASE_WEIGHT
) -> RolloutWorkspace:
    network = ACTOR.kernel_network if network is None else network
    assert network is not None
    people, state = batch.world.people, batch.state.people
    observation = new_observation_workspace(batch.arm, people, state, new_motion_predictor())
    return new_rollout_workspace(batch.arm, network, base_weight, observation, batch.n_envs)


def standing(n_envs: int) -> ReachBatch:
    """Return robots in motion beside people at rest."""
    batch = walked(batch_of(n_envs, "constant"), 15)
    rows = batch.state.people.walkers.rows
    rows[:, 0, GAIT], rows[:, 0, [VX, VY]] = STILL, 0.0
    return batch


def simulate(
    batch: ReachBatch,
    e: int,
    candidate: candidates.CandidateSequence,
    beginning: rollout.Beginning,
    work: RolloutWorkspace,
) -> int:
    """Predict the people and simulate one candidate; return its outcome."""
    rule = batch.settings.action.rule()
    predict_people(batch.world, batch.state, e, N_MOMENTS, work.observation, work.people)
    found = rollout.simulate_candidate(
        batch.world, rule, batch.state, e, candidate, beginning, work
    )
    return int(found[0])


def straight(batch: ReachBatch, e: int, work: RolloutWorkspace) -> np.ndarray:
    """Return the action of a straight motion to the goal."""
    place_robot(batch.arm, batch.state.q[e], work.observation.robot)
    rollout.write_straight(batch.world, batch.state.goal[e], work)
    return work.act.copy()


def test_rollout_of_the_policy_matches_what_happens_beside_constant_people() -> None:
    batch = walked(batch_of(150, "constant"), 15)
    live = np.flatnonzero(batch.state.outcome == RUNNING)
    work, expected = workspace(batch), {}
    acts = controller_of(ACTOR, "direct").acts(batch)
    for e in live:
        work.best_act[:] = acts[e]
        policy = candidates.candidate_of(POLICY)
        expected[e] = simulate(batch, e, policy, rollout.Beginning(0, 1.0), work)
    walked(batch, round(HORIZON_STEPS * STEP_S / batch.arm.dt))
    found = batch.state.outcome[live]
    same = [expected[e] == end for e, end in zip(live, found, strict=True)]
    assert (found == SUCCESS).sum() > 30
    assert np.mean(same) > 0.85


def test_evasions_end_as_simulated() -> None:
    """Each environment executes one evasion, with a person only in the far corner."""
    n_envs = candidates.N_DETERMINISTIC - candidates.N_FIXED
    batch = batch_of(n_envs, "constant")
    rows = batch.state.people.walkers.rows
    rows[:, 0, [X, Y]], rows[:, 0, GAIT] = (-2.0, 2.0), STILL
    rows[:, 0, [VX, VY]] = 0.0
    live = np.flatnonzero(walked(batch, 45).state.outcome == RUNNING)
    work, expected = workspace(batch), np.zeros(n_envs, dtype=np.int64)
    evasions = [candidates.candidate_of(candidates.N_FIXED + e) for e in range(n_envs)]
    for e in live:
        expected[e] = simulate(batch, e, evasions[e], rollout.Beginning(0, 1.0), work)
    cycles = round(STEP_S / batch.arm.dt)
    for k in range(HORIZON_STEPS * cycles):
        act = np.zeros((n_envs, 6), dtype=np.float32)
        for e, (kind, steps) in enumerate(evasions):
            if k < steps * cycles:
                act[e, :3] = candidates.SIGNS[kind - candidates.EVASION]
        batch.step(act, auto_reset=False)
    np.testing.assert_array_equal(batch.state.outcome[live], expected[live])
    assert {RUNNING, COLLISION} <= set(expected[live])


def test_sampled_candidates_end_as_simulated() -> None:
    batch = standing(60)
    work, rng = workspace(batch), np.zeros(1, dtype=np.uint64)
    random.start_stream(1, 2, 3, rng)
    aims, steps, expected = np.zeros((60, 6)), np.zeros(60, dtype=int), np.zeros(60)
    live = np.flatnonzero(batch.state.outcome == RUNNING)
    for e in live:
        steps[e] = candidates.sample_waypoint(batch.arm, batch.state.q[e], rng, work.waypoint)
        aims[e] = work.waypoint
        sample = candidates.CandidateSequence(candidates.SAMPLE, steps[e])
        expected[e] = simulate(batch, e, sample, rollout.Beginning(0, 0.0), work)
    for step in range(candidates.SAMPLE_STEPS):
        act = np.zeros((60, 6), dtype=np.float32)
        for e in live:
            if step < steps[e]:
                candidates.write_joint_move(batch.arm, aims[e], batch.state.q[e], act[e])
            else:
                act[e] = straight(batch, e, work)
        for _ in range(round(STEP_S / batch.arm.dt)):
            batch.step(act, auto_reset=False)
    np.testing.assert_array_equal(batch.state.outcome[live], expected[live])
    assert len(set(expected[live])) == 3


def test_remaining_plans_end_as_simulated_at_first() -> None:
    """Simulated in every control period, the remainder comes equally near to the goal."""
    batch = standing(60)
    work, rng = workspace(batch), np.zeros(1, dtype=np.uint64)
    cycles = round(STEP_S / batch.arm.dt)
    random.start_stream(1, 2, 3, rng)
    expected, closest = np.zeros(60, dtype=np.int64), np.full(60, np.inf)
    work.plan[:] = candidates.N_DETERMINISTIC, -1
    for e in range(60):
        work.plan_steps[e] = candidates.sample_waypoint(
            batch.arm, batch.state.q[e], rng, work.plan_waypoint[e]
        )
    for _ in range(cycles * candidates.SAMPLE_STEPS):
        for e in np.flatnonzero(batch.state.outcome == RUNNING):
            plan = kernel.remaining_plan(e, work, batch.arm.dt)
            beginning = rollout.Beginning(work.plan[e, 1] % cycles, 0.0)
            expected[e] = simulate(batch, e, plan, beginning, work)
            work.last_act[e] = work.first_act
            if expected[e] == SUCCESS:
                assert closest[e] in (np.inf, pytest.approx(work.closest[0]))
                closest[e] = work.closest[0]
        batch.step(work.last_act, auto_reset=False)
    ended = batch.state.outcome != RUNNING
    np.testing.assert_array_equal(batch.state.outcome[ended], expected[ended])
    assert ((closest < np.inf) & (batch.state.outcome == SUCCESS)).sum() > 5


def test_perturbed_waypoints_stay_within_the_joint_limits() -> None:
    batch = batch_of(1, "constant")
    rng, out = np.zeros(1, dtype=np.uint64), np.zeros(6)
    drawn = []
    for k in range(200):
        random.start_stream(0, 0, k, rng)
        aim = batch.arm.limits.q_max if k % 2 else batch.arm.home
        drawn.append((candidates.perturb_waypoint(batch.arm, aim, 3, rng, out), *out))
        assert (out >= batch.arm.limits.q_min).all() and (out <= batch.arm.limits.q_max).all()
    assert min(row[0] for row in drawn) == 0 and max(row[0] for row in drawn) > 8
    assert len(set(drawn)) == 200


def test_rollouts_are_reproducible() -> None:
    batch = walked(batch_of(60, "walker"), 70)
    acts = controller_of(ACTOR, "direct").acts(batch)
    first, again = acts.copy(), acts.copy()
    chosen = [RolloutImprovement(ACTOR).improve(batch, given) for given in (first, again)]
    np.testing.assert_array_equal(*chosen)
    np.testing.assert_array_equal(first, again)


@pytest.mark.parametrize("people", [("constant",), ()])
def test_motion_into_the_table_is_replaced(people: tuple[str, ...]) -> None:
    """A policy that only lowers the arm, with no person near, or no person at all."""
    batch = batch_of(1, *people)
    batch.state.people.walkers.rows[0, :, [X, Y]] = [[-2.0], [2.0]]
    n_obs, lowers = ACTOR.n_obs, np.zeros(6, dtype=np.float32)
    lowers[1] = 3.0
    layers = [np.zeros(shape, dtype=np.float32) for shape in ((n_obs, 4), 4, (4, 4), 4, (4, 6))]
    work = workspace(batch, Network(*layers, lowers), 0.0)
    rule, act = batch.settings.action.rule(), np.tanh(lowers)[None]
    chosen = np.full(1, POLICY)
    for _ in range(100):
        given = act.copy()
        kernel.improve_batch(batch.world, rule, batch.state, given, work, chosen)
        if chosen[0] != POLICY:
            break
        batch.step(given, auto_reset=False)
    assert batch.state.clear[0, 0] > 0.5, "no person is near"
    assert chosen[0] >= 0
    assert not np.array_equal(given, act)


def test_plans_are_continued_no_longer_than_their_duration() -> None:
    batch, improvement, continued = batch_of(240, "walker"), RolloutImprovement(ACTOR), 0
    controller = controller_of(ACTOR, "direct")
    cycles, before = round(STEP_S / batch.arm.dt), np.zeros((240, 6), dtype=np.float32)
    for _ in range(90):
        acts = controller.acts(batch)
        chosen = improvement.improve(batch, acts)
        work = improvement._work
        assert work is not None
        for e in np.flatnonzero((chosen != POLICY) & (work.plan[:, 1] > 0)):
            kind, steps = candidates.candidate_of(chosen[e])
            assert work.plan[e, 0] == chosen[e]
            assert work.plan[e, 1] < steps * cycles
            if kind < candidates.STRAIGHT:
                wanted = np.zeros(6, dtype=np.float32)
                q = batch.state.q[e]
                if work.plan[e, 1] % cycles:
                    wanted = before[e]
                elif kind < candidates.STOP:
                    candidates.write_joint_move(batch.arm, work.vias[kind], q, wanted)
                np.testing.assert_array_equal(acts[e], wanted)
                continued += 1
        before = acts
        batch.step(acts, auto_reset=False)
    assert continued > 20


def test_rollouts_reduce_collisions() -> None:
    """Beside two people, where few episodes contain enough collisions to compare."""
    goals = target_goals(ACTOR.targets, 270)
    settings = batch_of(1, "walker", "walker").settings
    modes = ("direct", "direct-rollout")
    ends = [
        run_episodes(CELL, settings, controller_of(ACTOR, how), goals, 5).outcome
        for how in modes
    ]
    without, with_rollout = ((end == COLLISION).sum() for end in ends)
    assert with_rollout < without
    assert (ends[1] == SUCCESS).mean() >= (ends[0] == SUCCESS).mean()


def test_actions_are_kept_in_an_empty_cell() -> None:
    batch = walked(batch_of(4), 3)
    acts = controller_of(ACTOR, "direct").acts(batch)
    kept = acts.copy()
    assert (RolloutImprovement(ACTOR).improve(batch, acts) == POLICY).all()
    np.testing.assert_array_equal(acts, kept)


@pytest.mark.parametrize("people", [("walker", "walker"), ("worker", "walker")])
def test_improved_actions_stay_in_range_beside_several_people(people: tuple[str, ...]) -> None:
    batch = walked(batch_of(40, *people), 10)
    acts = controller_of(ACTOR, "direct").acts(batch)
    chosen = RolloutImprovement(ACTOR).improve(batch, acts)
    assert np.abs(acts).max() <= 1.0
    assert ((chosen >= POLICY) & (chosen < len(CANDIDATES))).all()


def test_every_candidate_has_a_name() -> None:
    assert len(CANDIDATES) == len(set(CANDIDATES)) == candidates.N_DETERMINISTIC + 1
    assert CANDIDATES[candidates.STRAIGHT_CANDIDATE] == "straight"
    assert CANDIDATES[0] == "home-0.08s"
    assert CANDIDATES[-2:] == ("bang-bang-bbb-0.6s", "sampled")


@pytest.mark.parametrize(
    ("dt", "divides"),
    [(0.01, True), (0.02, True), (0.04, True), (0.016, False), (0.05, False), (0.1, False)],
)
def test_rollouts_need_a_control_period_that_divides_their_step(
    dt: float, divides: bool
) -> None:
    robot = CELL.robot.model_copy(update={"dt": dt})
    cell = CELL.model_copy(update={"name": "other-period", "robot": robot})
    actor = ReachPolicy(untrained_reach(cell=cell, width=16))
    assert can_roll_out(actor) is divides
    assert ("direct-rollout" in inference_modes_of(actor)) is divides
    if not divides:
        query = MotionQuery(
            q=np.array(robot.home_q),
            qd=np.zeros(6),
            goal=np.array([0.0, 0.9, 0.3]),
            people=(),
            rollout=True,
        )
        with pytest.raises(InvalidInput, match="dt of the cell that divides 0.04 s"):
            MotionDecider(actor, cell).decide(query)


def test_rollouts_need_environments_with_the_policys_control_period() -> None:
    robot = CELL.robot.model_copy(update={"dt": 0.01})
    other = CELL.model_copy(update={"robot": robot})
    batch = ReachBatch(other, 2, 3, ReachSettings(observation="forecast"))
    batch.reset()
    with pytest.raises(InvalidInput, match=r"robot\.dt = 0\.01 must be 0\.02 s"):
        RolloutImprovement(ACTOR).improve(batch, np.zeros((2, 6), dtype=np.float32))


def test_other_policies_cannot_be_simulated() -> None:
    actor = RandomActor()
    assert can_roll_out(ACTOR) and not can_roll_out(actor)
    assert "direct-rollout" in inference_modes_of(
        ACTOR
    ) and "direct-rollout" not in inference_modes_of(actor)
    with pytest.raises(InvalidInput, match="rollouts"):
        controller_of(actor, "direct-rollout")
