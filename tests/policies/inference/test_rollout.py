"""Looking ahead: what is played is what happens, and contacts become fewer."""

import numpy as np
import pytest

from app.errors import InvalidInput
from app.policies.checkpoints import pretrained
from app.policies.evaluation.reach.episodes import play, target_goals
from app.policies.inference.controllers import controller_of, inference_modes_of
from app.policies.inference.reach_policy import ReachPolicy
from app.policies.inference.rollout import OTHERS, PASSED, Lookahead, can_roll_out
from app.policies.networks.actor_critic import BASE_WEIGHT
from app.sim.cells.cell import load_cell
from app.sim.core.kernels import rng as random
from app.sim.people.kernels.pedestrian import GAIT, STILL, VX, VY, X, Y
from app.sim.prediction.kernels.networks import STEP_S, Network
from app.sim.prediction.weights import new_motion_predictor
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.kernels.episode import Work, new_work
from app.sim.reach.rollout.kernels import candidates as other_ways
from app.sim.reach.rollout.kernels import improvement as kernel
from app.sim.reach.rollout.kernels import rollout as played_ways
from app.sim.reach.rollout.kernels.prediction import MOMENTS, N_PLAYED, foretell
from app.sim.robot.kernels.arm import place_robot
from app.sim.scenario.kernels.episode import COLLISION, RUNNING, SUCCESS
from tests.policies.inference.test_controllers import RandomActor

CELL = load_cell("shared-workspace")
POLICY = ReachPolicy(pretrained.load("reach"))


def batch_of(n_envs: int, *people: str, seed: int = 3) -> ReachBatch:
    settings = ReachSettings(people=people, observation="forecast", start="clearance")
    batch = ReachBatch(CELL, n_envs, seed, settings)
    batch.reset()
    return batch


def walked(batch: ReachBatch, periods: int) -> ReachBatch:
    """Let the policy move on, so that robots are on their way."""
    mover = controller_of(POLICY, "direct")
    for _ in range(periods):
        batch.step(mover.acts(batch), auto_reset=False)
    return batch


def looked(n_envs: int, *people: str) -> tuple[played_ways.Lookahead, Work, ReachBatch]:
    """Return work space, and robots that are on their way."""
    batch = walked(batch_of(n_envs, *people), 15)
    network = POLICY.kernel_network
    assert network is not None
    look = played_ways.new_lookahead(batch.arm, network, BASE_WEIGHT, n_envs)
    return look, new_work(batch.world, batch.state, new_motion_predictor()), batch


def test_what_is_played_is_what_happens_beside_constant_people() -> None:
    """Straight ahead without turns: outcomes within the horizon are told before."""
    batch = walked(batch_of(150, "constant"), 15)
    live = np.flatnonzero(batch.state.outcome == RUNNING)
    network = POLICY.kernel_network
    assert network is not None
    look = played_ways.new_lookahead(batch.arm, network, BASE_WEIGHT, 150)
    work = new_work(batch.world, batch.state, new_motion_predictor())
    rule, told = batch.settings.action.rule(), {}
    acts = controller_of(POLICY, "direct").acts(batch)
    for row in live:
        n = foretell(batch.world, batch.state, row, MOMENTS, work, look.foretold)
        look.begun[:] = acts[row]
        told[row] = played_ways.play(
            batch.world, rule, batch.state, row, PASSED, 0, 0, 1.0, n, work, look
        )[0]
    walked(batch, round(N_PLAYED * STEP_S / batch.arm.dt))
    found = batch.state.outcome[live]
    same = [told[row] == end for row, end in zip(live, found, strict=True)]
    assert (found == SUCCESS).sum() > 30
    assert np.mean(same) > 0.85


def test_dashes_end_as_they_are_played() -> None:
    """The robot is driven by hand as each dash says, with nobody but in the far corner."""
    dashes = other_ways.N_DRAWN - other_ways.N_FIRST
    batch = batch_of(dashes, "constant")
    rows = batch.state.people.walkers.rows
    rows[:, 0, [X, Y]], rows[:, 0, GAIT] = (-2.0, 2.0), STILL
    rows[:, 0, [VX, VY]] = 0.0
    live = np.flatnonzero(walked(batch, 45).state.outcome == RUNNING)
    network = POLICY.kernel_network
    assert network is not None
    look = played_ways.new_lookahead(batch.arm, network, BASE_WEIGHT, dashes)
    work = new_work(batch.world, batch.state, new_motion_predictor())
    rule, told = batch.settings.action.rule(), np.zeros(dashes, dtype=np.int64)
    for row in live:
        n = foretell(batch.world, batch.state, row, MOMENTS, work, look.foretold)
        way = other_ways.way_of(other_ways.N_FIRST + row)
        told[row] = played_ways.play(
            batch.world, rule, batch.state, row, *way, 0, 1.0, n, work, look
        )[0]
    periods = round(STEP_S / batch.arm.dt)
    for k in range(N_PLAYED * periods):
        act = np.zeros((dashes, 6), dtype=np.float32)
        for row in range(dashes):
            posture, lasting = other_ways.way_of(other_ways.N_FIRST + row)
            if k < lasting * periods:
                act[row, :3] = other_ways.SIGNS[posture - other_ways.DASH]
        batch.step(act, auto_reset=False)
    np.testing.assert_array_equal(batch.state.outcome[live], told[live])
    assert {RUNNING, COLLISION} <= set(told[live])


def test_darts_end_as_they_are_played() -> None:
    """Each row draws its own; beside people whose future is known it ends as was told."""
    n_envs, look, work, batch = 60, *looked(60, "constant")
    rows = batch.state.people.walkers.rows
    rows[:, 0, GAIT], rows[:, 0, [VX, VY]] = STILL, 0.0
    rule, rng = batch.settings.action.rule(), np.zeros(1, dtype=np.uint64)
    random.start_stream(1, 2, 3, rng)
    aims, lasting, told = np.zeros((n_envs, 6)), np.zeros(n_envs, dtype=int), np.zeros(n_envs)
    live = np.flatnonzero(batch.state.outcome == RUNNING)
    for row in live:
        n = foretell(batch.world, batch.state, row, MOMENTS, work, look.foretold)
        lasting[row] = other_ways.draw_dart(batch.arm, batch.state.q[row], rng, look.dart)
        aims[row] = look.dart
        told[row] = played_ways.play(
            batch.world, rule, batch.state, row, other_ways.DART, lasting[row],
            0, 0.0, n, work, look,
        )[0]  # fmt: skip
    periods = round(STEP_S / batch.arm.dt)
    for step in range(other_ways.DART_PLAYED):
        act = np.zeros((n_envs, 6), dtype=np.float32)
        for row in live:
            if step < lasting[row]:
                q = batch.state.q[row]
                other_ways.write_toward(batch.arm, aims[row], q, act[row])
            else:
                act[row] = straight(batch, row, work, look)
        for _ in range(periods):
            batch.step(act, auto_reset=False)
    np.testing.assert_array_equal(batch.state.outcome[live], told[live])
    assert len(set(told[live])) == 3


def test_what_is_gone_on_with_is_what_was_played() -> None:
    """Played anew every period, what is left of a dart comes as near as was told at first."""
    n_envs, look, work, batch = 60, *looked(60, "constant")
    rows = batch.state.people.walkers.rows
    rows[:, 0, GAIT], rows[:, 0, [VX, VY]] = STILL, 0.0
    periods = round(STEP_S / batch.arm.dt)
    rule, rng = batch.settings.action.rule(), np.zeros(1, dtype=np.uint64)
    random.start_stream(1, 2, 3, rng)
    told, came = np.zeros(n_envs, dtype=np.int64), np.full(n_envs, np.inf)
    look.plan[:] = other_ways.N_DRAWN, -1
    for row in range(n_envs):
        look.darting[row] = other_ways.draw_dart(
            batch.arm, batch.state.q[row], rng, look.darts[row]
        )
    for _ in range(periods * other_ways.DART_PLAYED):
        live = np.flatnonzero(batch.state.outcome == RUNNING)
        for row in live:
            n = foretell(batch.world, batch.state, row, MOMENTS, work, look.foretold)
            way = kernel._left(row, look, batch.arm.dt)
            gone = look.plan[row, 1] % periods
            told[row], _ = played_ways.play(
                batch.world, rule, batch.state, row, *way, gone, 0.0, n, work, look
            )
            look.last[row] = look.found
            if told[row] == SUCCESS:
                assert came[row] in (np.inf, pytest.approx(look.came[0]))
                came[row] = look.came[0]
        batch.step(look.last, auto_reset=False)
    ended = batch.state.outcome != RUNNING
    np.testing.assert_array_equal(batch.state.outcome[ended], told[ended])
    assert ((came < np.inf) & (batch.state.outcome == SUCCESS)).sum() > 5


def straight(
    batch: ReachBatch, row: int, work: Work, look: played_ways.Lookahead
) -> np.ndarray:
    """Return the action that leads the tcp of a row straight to its goal."""
    place_robot(batch.arm, batch.state.q[row], work.robot)
    played_ways._straight(batch.world, batch.state.goal[row], work, look)
    return look.act.copy()


def test_a_dart_like_another_one_stays_within_the_joints() -> None:
    _, _, batch = looked(1, "constant")
    rng, out = np.zeros(1, dtype=np.uint64), np.zeros(6)
    drawn = []
    for k in range(200):
        random.start_stream(0, 0, k, rng)
        aim = batch.arm.limits.q_max if k % 2 else batch.arm.home
        drawn.append((other_ways.vary_dart(batch.arm, aim, 3, rng, out), *out))
        assert (out >= batch.arm.limits.q_min).all() and (out <= batch.arm.limits.q_max).all()
    assert min(row[0] for row in drawn) == 0 and max(row[0] for row in drawn) > 8
    assert len(set(drawn)) == 200


def test_looking_ahead_draws_the_same_again() -> None:
    batch = walked(batch_of(60, "walker"), 70)
    acts = controller_of(POLICY, "direct").acts(batch)
    first, again = acts.copy(), acts.copy()
    chosen = [Lookahead(POLICY).improve(batch, given) for given in (first, again)]
    np.testing.assert_array_equal(*chosen)
    np.testing.assert_array_equal(first, again)


@pytest.mark.parametrize("people", [("constant",), ()])
def test_a_way_into_the_table_is_changed(people: tuple[str, ...]) -> None:
    """A policy that only lowers the arm, with nobody near, or nobody at all."""
    batch = batch_of(1, *people)
    batch.state.people.walkers.rows[0, :, [X, Y]] = [[-2.0], [2.0]]
    n_obs, lowers = POLICY.n_obs, np.zeros(6, dtype=np.float32)
    lowers[1] = 3.0
    layers = [np.zeros(shape, dtype=np.float32) for shape in ((n_obs, 4), 4, (4, 4), 4, (4, 6))]
    look = played_ways.new_lookahead(batch.arm, Network(*layers, lowers), 0.0, 1)
    work = new_work(batch.world, batch.state, new_motion_predictor())
    rule, act = batch.settings.action.rule(), np.tanh(lowers)[None]
    way = np.full(1, PASSED)
    for _ in range(100):
        given = act.copy()
        kernel.look_ahead_batch(batch.world, rule, batch.state, given, work, look, way)
        if way[0] != PASSED:
            break
        batch.step(given, auto_reset=False)
    assert batch.state.clear[0, 0] > 0.5, "nobody is near"
    assert way[0] >= 0
    assert not np.array_equal(given, act)


def test_a_way_begun_is_gone_on_with_for_no_longer_than_it_lasts() -> None:
    batch, ahead, goes_on = batch_of(300, "walker"), Lookahead(POLICY), 0
    mover = controller_of(POLICY, "direct")
    periods, before = round(STEP_S / batch.arm.dt), np.zeros((300, 6), dtype=np.float32)
    for _ in range(90):
        acts = mover.acts(batch)
        chosen = ahead.improve(batch, acts)
        assert ahead._work is not None
        look = ahead._work[1]
        for e in np.flatnonzero((chosen != PASSED) & (look.plan[:, 1] > 0)):
            posture, lasting = other_ways.way_of(chosen[e])
            assert look.plan[e, 0] == chosen[e]
            assert look.plan[e, 1] < lasting * periods
            if posture < other_ways.STRAIGHT:
                wanted = np.zeros(6, dtype=np.float32)
                q = batch.state.q[e]
                if look.plan[e, 1] % periods:
                    wanted = before[e]
                elif posture < other_ways.STOP:
                    other_ways.write_toward(batch.arm, look.aim[posture], q, wanted)
                np.testing.assert_array_equal(acts[e], wanted)
                goes_on += 1
        before = acts
        batch.step(acts, auto_reset=False)
    assert goes_on > 20


def test_fewer_contacts_than_alone() -> None:
    """Beside two people, where there are enough contacts to tell by so few episodes."""
    goals = target_goals(POLICY.targets, 270)
    settings = batch_of(1, "walker", "walker").settings
    ends = [play(CELL, settings, controller_of(POLICY, how), goals, 5).outcome for how in (
        "direct", "direct-rollout")]  # fmt: skip
    alone, ahead = ((end == COLLISION).sum() for end in ends)
    assert ahead < alone
    assert (ends[1] == SUCCESS).mean() >= (ends[0] == SUCCESS).mean()


def test_nobody_to_look_out_for() -> None:
    batch = walked(batch_of(4), 3)
    acts = controller_of(POLICY, "direct").acts(batch)
    kept = acts.copy()
    assert (Lookahead(POLICY).improve(batch, acts) == PASSED).all()
    np.testing.assert_array_equal(acts, kept)


@pytest.mark.parametrize("people", [("walker", "walker"), ("worker", "walker")])
def test_with_several_people_actions_stay_actions(people: tuple[str, ...]) -> None:
    batch = walked(batch_of(40, *people), 10)
    acts = controller_of(POLICY, "direct").acts(batch)
    chosen = Lookahead(POLICY).improve(batch, acts)
    assert np.abs(acts).max() <= 1.0
    assert ((chosen >= PASSED) & (chosen < len(OTHERS))).all()


def test_the_names_of_the_other_ways() -> None:
    assert len(OTHERS) == len(set(OTHERS)) == other_ways.N_OTHERS
    assert OTHERS[other_ways.STRAIGHT_WAY] == "straight" and OTHERS[0] == "home-0.08s"
    assert OTHERS[-2:] == ("dash-bbb-0.6s", "dart")


def test_other_policies_cannot() -> None:
    actor = RandomActor()
    assert can_roll_out(POLICY) and not can_roll_out(actor)
    assert "direct-rollout" in inference_modes_of(
        POLICY
    ) and "direct-rollout" not in inference_modes_of(actor)
    with pytest.raises(InvalidInput, match="look ahead"):
        controller_of(actor, "direct-rollout")
