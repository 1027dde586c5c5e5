"""A reach cell under the safety layer: the same motion where nobody is near, none too near."""

from dataclasses import replace

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.cells.cell import load_cell
from app.sim.collision.checker import no_people
from app.sim.collision.contact import clearance
from app.sim.people.kernels.pedestrian import AGE, N_PAST, PAST_RADIUS, PAST_SPEED
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.monitored.batch import MonitoredReachBatch
from app.sim.robot.actions import ActionSettings
from app.sim.safety.layer import SafetyLayer, safety_settings
from app.sim.scenario.kernels.episode import (
    COLLISION,
    RUNNING,
    SUCCESS,
    TIMEOUT,
    UNFEASIBLE,
)
from app.sim.scenario.monitoring import MonitoringSettings
from app.sim.scene.scene import NO_CYLINDERS, people_of
from tests.sim.driven_batches import straight

CELL = load_cell("shared-workspace")
SAFETY = safety_settings(CELL)
BOX = ReachSettings(goals="box")
ALONE = replace(BOX, people=())
STILL = 0.0


def to_the_end(batch: ReachBatch, still: bool = False) -> None:
    act = np.zeros((batch.n_envs, 6), dtype=np.float32)
    while (batch.state.outcome == RUNNING).any():
        batch.step(act if still else straight(batch), auto_reset=False)


def standing(x: float, y: float, r: float = 0.3, n: int = 1) -> np.ndarray:
    return np.tile([x, y, r], (n, 2, 1)).astype(float)


def passing(n: int, y: float = 1.2, speed: float = 1.0) -> np.ndarray:
    x = -2.0 + speed * 0.02 * np.arange(250)
    return np.repeat(np.column_stack([x, np.full(250, y), np.full(250, 0.3)])[None], n, axis=0)


def test_layer_changes_nothing_in_an_empty_cell():
    guarded, plain = (
        MonitoredReachBatch(CELL, 6, 3, ALONE, SAFETY),
        ReachBatch(CELL, 6, 3, ALONE),
    )
    np.testing.assert_array_equal(guarded.reset(), plain.reset())
    for _ in range(60):
        one = guarded.step(straight(guarded), auto_reset=False)
        other = plain.step(straight(plain), auto_reset=False)
        np.testing.assert_allclose(guarded.state.q, plain.state.q, atol=1e-12)
        np.testing.assert_allclose(one.obs, other.obs, atol=1e-6)
        np.testing.assert_allclose(one.rew, other.rew, atol=1e-6)
    assert (guarded.override == 1.0).all()


def test_people_walk_as_they_do_without_the_layer():
    guarded, plain = MonitoredReachBatch(CELL, 8, 5, BOX, SAFETY), ReachBatch(CELL, 8, 5, BOX)
    guarded.reset(), plain.reset()
    act = np.zeros((8, 6), dtype=np.float32)
    for _ in range(40):
        guarded.step(act, auto_reset=False), plain.step(act, auto_reset=False)
    both = (guarded.state.outcome == RUNNING) & (plain.state.outcome == RUNNING)
    assert both.sum() >= 4
    np.testing.assert_array_equal(
        guarded.state.people.cylinders[both], plain.state.people.cylinders[both]
    )


def test_one_step_bounds_can_end_unfeasible():
    action = ActionSettings(bounds="one-step", meaning="coefficient")
    settings = replace(ALONE, time_limit_s=25.0, action=action)
    batch = MonitoredReachBatch(CELL, 20, 3, settings, SAFETY)
    batch.reset()
    push = np.ones((20, 6), dtype=np.float32)
    push[:, 1:] = 0.0
    for _ in range(400):
        batch.step(push, auto_reset=False, features=False)
    assert (batch.state.outcome == UNFEASIBLE).any()


def test_a_period_that_is_stopped_costs_what_the_weights_say():
    dear = replace(BOX, weights=BOX.weights._replace(c_o=0.5))
    cheap, costly = (
        MonitoredReachBatch(CELL, 8, 5, BOX, SAFETY),
        MonitoredReachBatch(CELL, 8, 5, dear, SAFETY),
    )
    cheap.reset(), costly.reset()
    n_stopped = 0
    for _ in range(60):
        act = straight(cheap)
        went_on = cheap.state.outcome == RUNNING
        one, other = cheap.step(act, auto_reset=False), costly.step(act, auto_reset=False)
        stopped = went_on & (cheap.override <= 0.0)
        np.testing.assert_allclose(one.rew - other.rew, 0.5 * stopped, atol=1e-6)
        n_stopped += stopped.sum()
    assert n_stopped > 20


@pytest.mark.parametrize("safety", [SAFETY, replace(SAFETY, use_measured_velocity=True)])
def test_each_period_is_what_the_layer_decides(safety):
    batch = MonitoredReachBatch(
        CELL, 1, 0, replace(BOX, people=("walker",)), safety, tracks=passing(1, y=0.8)
    )
    batch.reset()
    layer, slowed = SafetyLayer(batch.arm, safety), 0
    for _ in range(120):
        q, qd = batch.state.q[0].copy(), batch.state.qd[0].copy()
        people = batch.people_shapes(0)
        batch.step(straight(batch), auto_reset=False)
        if batch.state.outcome[0] != RUNNING:
            break
        done = layer.decide(q, qd, batch._work.c, batch._work.d, people)
        assert batch.override[0] == done.override
        np.testing.assert_array_equal(batch.state.q[0], done.q)
        slowed += done.override < 1.0
    assert slowed > 10


def test_people_follow_their_tracks_and_are_seen_with_their_velocity():
    tracks = passing(3)
    batch = MonitoredReachBatch(
        CELL, 3, 0, replace(BOX, people=("walker",)), SAFETY, tracks=tracks
    )
    obs = batch.reset().copy()
    np.testing.assert_array_equal(batch.state.people.cylinders[:, 0], tracks[:, 0])
    np.testing.assert_allclose(
        obs[:, 12:17], [[-2.0, 1.2 - 1.25, 1.0, 0.0, 0.3]] * 3, atol=1e-6
    )
    still = np.zeros((3, 6), dtype=np.float32)
    for k in range(1, 30):
        batch.step(still, auto_reset=False)
        np.testing.assert_array_equal(batch.state.people.cylinders[:, 0], tracks[:, k])


def test_the_robot_never_moves_while_a_person_is_nearer_than_the_protective_distance():
    batch = MonitoredReachBatch(CELL, 30, 9, BOX, SAFETY)
    batch.reset()
    people, near = people_of(batch.cell), 0
    for _ in range(150):
        before = batch.state.q.copy()
        batch.step(straight(batch), auto_reset=False, features=False)
        for e in np.flatnonzero(batch.state.outcome == RUNNING)[:5]:
            cylinders = batch.state.people.cylinders[e]
            gap = clearance(batch.arm, people, before[e], np.zeros((0, 18)), cylinders).people_m
            if gap < SAFETY.protective_distance - 0.05:
                near += 1
                np.testing.assert_array_equal(batch.state.q[e], before[e])
    assert near > 20


def test_a_person_at_the_robot_holds_it_and_the_account_says_so():
    settings = replace(BOX, people=("walker",), time_limit_s=1.0)
    batch = MonitoredReachBatch(CELL, 2, 0, settings, SAFETY, tracks=standing(0.0, 0.8, n=2))
    batch.reset()
    to_the_end(batch)
    runs = batch.runs()
    np.testing.assert_allclose(runs.seconds, 1.0)
    np.testing.assert_allclose(runs.stopped_s, 1.0)
    np.testing.assert_allclose(runs.below_half_s, 1.0)
    np.testing.assert_allclose(runs.joint_path, 0.0)
    assert (batch.state.outcome == TIMEOUT).all()
    assert not runs.arrived.any()


def test_path_lengths_and_times_are_counted():
    batch = MonitoredReachBatch(CELL, 4, 2, ALONE, SAFETY)
    batch.reset()
    q, tips = [batch.state.q.copy()], []
    while (batch.state.outcome == RUNNING).any():
        batch.step(straight(batch), auto_reset=False)
        q.append(batch.state.q.copy())
        tips.append(batch.state.outcome.copy())
    runs = batch.runs()
    paths = np.linalg.norm(np.diff(q, axis=0), axis=2).sum(axis=0)
    np.testing.assert_allclose(runs.joint_path, paths)
    np.testing.assert_allclose(runs.seconds, 0.02 * (1 + (np.array(tips) == 0).sum(axis=0)))
    assert runs.arrived.all() and (batch.state.outcome == SUCCESS).all()
    assert (runs.tool_path > 0.2).all() and (runs.tool_path < runs.joint_path * 1.5).all()


def test_contacts_at_standstill_are_separate_from_contacts_in_motion():
    settings = replace(BOX, people=("walker",), time_limit_s=4.0)
    tracks = passing(2, y=0.6)
    held = MonitoredReachBatch(CELL, 2, 0, settings, SAFETY, tracks=tracks)
    held.reset()
    to_the_end(held, still=True)
    assert (held.state.outcome == COLLISION).all()
    assert held.runs().touched_at_rest.all() and not held.runs().touched_moving.any()
    bare = MonitoredReachBatch(
        CELL, 2, 0, settings, SAFETY, MonitoringSettings(active=False), tracks=tracks
    )
    bare.reset()
    act = np.zeros((2, 6), dtype=np.float32)
    act[:, 0] = 0.3
    while (bare.state.outcome == RUNNING).any():
        bare.step(act, auto_reset=False)
    assert bare.runs().touched_moving.all()
    assert (bare.runs().link_speed > 0.05).all()


def test_a_touched_robot_at_rest_may_go_on():
    settings = replace(BOX, people=("walker",), time_limit_s=10.0)
    batch = MonitoredReachBatch(
        CELL,
        2,
        0,
        settings,
        SAFETY,
        MonitoringSettings(rest_ends=False),
        tracks=passing(2, y=0.6),
    )
    batch.reset()
    for _ in range(150):
        batch.step(np.zeros((2, 6), dtype=np.float32), auto_reset=False)
    to_the_end(batch)
    runs = batch.runs()
    assert runs.touched_at_rest.all() and runs.arrived.all()


def test_policies_observe_no_more_time_than_their_horizon():
    batch = MonitoredReachBatch(
        CELL, 1, 0, replace(ALONE, time_limit_s=12.0), SAFETY, MonitoringSettings()
    )
    batch.reset()
    seen = [batch.state.time_left[0]]
    for _ in range(600):
        batch.step(np.zeros((1, 6), dtype=np.float32), auto_reset=False)
        seen.append(batch.state.time_left[0])
    assert max(seen) == 5.0
    assert seen[349] == 5.0 and seen[400] == pytest.approx(4.0)
    assert batch.state.outcome[0] == TIMEOUT


def test_a_planner_s_wanted_speeds_are_met_exactly():
    batch = MonitoredReachBatch(CELL, 2, 0, ALONE, SAFETY)
    batch.reset()
    assert batch.people_shapes(0).cylinders.shape == no_people().cylinders.shape
    wanted = np.array([0.05, -0.03, 0.0, 0.1, -0.1, 0.02])
    batch.step_speeds(1, wanted)
    np.testing.assert_allclose(batch.state.qd[1], wanted, atol=1e-15)
    np.testing.assert_array_equal(batch.state.qd[0], 0.0)


def test_tracks_that_do_not_fit_are_refused():
    walker = replace(BOX, people=("walker",))
    with pytest.raises(InvalidInput, match="one cylinder"):
        MonitoredReachBatch(CELL, 1, 0, ALONE, SAFETY, tracks=standing(0.0, 1.0))
    with pytest.raises(InvalidInput, match="shape"):
        MonitoredReachBatch(CELL, 2, 0, walker, SAFETY, tracks=standing(0.0, 1.0))
    batch = MonitoredReachBatch(CELL, 1, 0, walker, SAFETY, tracks=standing(0.0, 1.0))
    batch.reset()
    with pytest.raises(InvalidInput, match="auto_reset"):
        batch.step(np.zeros((1, 6), dtype=np.float32))
    assert NO_CYLINDERS.shape == (0, 3)


def test_people_on_tracks_are_remembered():
    tracks = passing(2, speed=0.8)
    tracks[:, :, 2] += 0.001 * np.arange(250)
    batch = MonitoredReachBatch(CELL, 2, 3, BOX, SAFETY, tracks=tracks)
    batch.reset()
    act = np.zeros((2, 6), dtype=np.float32)
    for _ in range(40):
        batch.step(act, auto_reset=False)
    for row in batch.state.people.walkers.rows[:, 0]:
        assert row[AGE] == 0.0
        np.testing.assert_allclose(
            row[PAST_RADIUS:PAST_SPEED], 0.3 + 0.001 * np.maximum(40 - 5 * np.arange(N_PAST), 0)
        )
        np.testing.assert_allclose(row[PAST_SPEED:], 0.8)
