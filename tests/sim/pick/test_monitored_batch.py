"""A pick cell under the safety layer: people are touched by the robot at standstill only."""

from dataclasses import replace

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.collision.checker import Shapes, capsule_shapes
from app.sim.human import model as human
from app.sim.people.human_motion_config import HumanMotionConfig
from app.sim.pick.batch import WHOLE_PICK, PickBatch
from app.sim.pick.kernels.grasp import GraspRules
from app.sim.pick.monitored_batch import AMONG_HANDS, MonitoredPickBatch
from app.sim.safety.layer import SafetyLayer, SafetySettings
from app.sim.scenario.kernels.episode import RUNNING, SUCCESS
from app.sim.scenario.monitoring import MonitoredEpisodes, MonitoringSettings

CELL = load_cell("pick-and-place")
CONTINUES = MonitoringSettings(rest_ends=False)
BARE = MonitoringSettings(active=False, rest_ends=False)


def monitored(
    n: int, monitoring: MonitoringSettings = CONTINUES, safety: SafetySettings = AMONG_HANDS
) -> MonitoredPickBatch:
    return MonitoredPickBatch(CELL, n, 3, WHOLE_PICK, safety, monitoring)


def straight(batch: PickBatch) -> np.ndarray:
    """Return the actions straight to the configurations of the present phases."""
    state = batch.state
    low = (state.phase == 1)[:, None]
    wanted = np.where(low, state.q_grasp, state.q_goal)
    return np.clip(3.0 * (wanted - state.q)[:, :5] / 0.5, -1, 1).astype(np.float32)


def people_of(batch: PickBatch, e: int) -> Shapes:
    """Return the capsules of the workers of an environment from their joints and sizes.

    Their speeds are central differences over 2 microseconds.
    """
    people, sized, step = batch.state.people, [], 1e-6
    for q, qd, size in zip(people.q[e], people.qd[e], people.size[e], strict=True):
        before, ends, after = (
            human.capsules(q + at * qd, size, CELL.floor_z) for at in (-step, 0.0, step)
        )
        speeds = np.linalg.norm(after - before, axis=2).max(axis=1) / (2.0 * step)
        sized.append((ends, human.capsule_radii(size), speeds))
    ends, radii, speeds = (np.concatenate(part) for part in zip(*sized, strict=True))
    shapes = capsule_shapes(ends, radii)
    unused = shapes.capsules.shape[1] - len(speeds)
    return replace(shapes, speed=np.append(speeds, np.zeros(unused)))


def to_the_end(batch: MonitoredPickBatch) -> MonitoredEpisodes:
    batch.reset()
    while (batch.state.outcome == RUNNING).any():
        batch.step(straight(batch), auto_reset=False, features=False)
    return batch.runs()


def test_layer_changes_nothing_in_an_empty_cell():
    alone = replace(WHOLE_PICK, people=())
    guarded = MonitoredPickBatch(CELL, 6, 3, alone, SafetySettings(), CONTINUES)
    plain = PickBatch(CELL, 6, 3, alone)
    np.testing.assert_array_equal(guarded.reset(), plain.reset())
    for _ in range(120):
        one = guarded.step(straight(guarded), auto_reset=False)
        other = plain.step(straight(plain), auto_reset=False)
        np.testing.assert_allclose(guarded.state.q, plain.state.q, atol=1e-12)
        np.testing.assert_allclose(one.obs, other.obs, atol=1e-6)
        np.testing.assert_allclose(one.rew, other.rew, atol=1e-6)
        np.testing.assert_array_equal(one.ended, other.ended)
    assert (guarded.state.outcome == SUCCESS).all()


@pytest.mark.parametrize("guarded", [True, False])
def test_capsules_of_workers_are_stored_whole(guarded):
    batch = monitored(8) if guarded else PickBatch(CELL, 8, 3, WHOLE_PICK)
    batch.reset()
    for _ in range(5):
        for e in range(8):
            stored = batch.state.people.capsules[e]
            np.testing.assert_allclose(stored, people_of(batch, e).capsules, atol=1e-9)
        batch.step(straight(batch), auto_reset=False)


def test_each_period_is_what_the_layer_decides():
    quick = replace(WHOLE_PICK, work=HumanMotionConfig(pace=2.0))
    batch = MonitoredPickBatch(CELL, 8, 3, quick, AMONG_HANDS, CONTINUES)
    batch.reset()
    layer, slowed, faster = SafetyLayer(batch.arm, AMONG_HANDS), 0, 0
    for _ in range(60):
        q, qd = batch.state.q.copy(), batch.state.qd.copy()
        people = people_of(batch, 7)
        batch.step(straight(batch), auto_reset=False)
        e = 7  # the work space holds the command of the environment stepped last
        if batch.state.outcome[e] != RUNNING:
            break
        done = layer.decide(q[e], qd[e], batch._work.c, batch._work.d, people)
        np.testing.assert_allclose(batch.state.q[e], done.q, atol=1e-9)
        slowed += done.override < 1.0
        assert people.speed is not None
        faster += people.speed.max() > AMONG_HANDS.human_speed
    assert slowed > 5 and faster > 5


def test_the_moving_robot_touches_no_person_and_takes_longer():
    guarded, bare = to_the_end(monitored(60)), to_the_end(monitored(60, BARE))
    assert bare.touched_moving.sum() > 3
    assert not guarded.touched_moving.any()
    assert guarded.touched_at_rest.any()
    both = guarded.arrived & bare.arrived
    assert (guarded.seconds - bare.seconds)[both].mean() > 0.2
    assert (bare.override == 1.0).all() and (guarded.override < 1.0).any()
    assert (guarded.override >= 0.0).all()


def test_a_touched_robot_at_standstill_may_go_on_or_end_the_episode():
    ends = to_the_end(monitored(60, MonitoringSettings(rest_ends=True)))
    continues = to_the_end(monitored(60))
    assert (continues.arrived & continues.touched_at_rest).any()
    assert not (ends.arrived & ends.touched_at_rest).any()
    np.testing.assert_array_equal(ends.touched_at_rest, continues.touched_at_rest)


def test_power_and_force_limiting_admits_contacts_up_to_its_speeds():
    runs = to_the_end(monitored(60, safety=replace(AMONG_HANDS, pfl=True)))
    touched = runs.touched_moving
    assert touched.sum() > 3
    assert (runs.link_speed[touched] <= runs.allowed_speed[touched] + 1e-9).all()
    assert runs.override.mean() > 0.9


@pytest.mark.parametrize("grasp", [GraspRules(), GraspRules(depth=0.0)])
def test_parts_of_a_batch_equal_the_whole(grasp):
    settings = replace(WHOLE_PICK, grasp=grasp)
    whole = MonitoredPickBatch(CELL, 6, 5, settings, AMONG_HANDS, CONTINUES)
    part = MonitoredPickBatch(CELL, 3, 5, settings, AMONG_HANDS, CONTINUES, first_env=3)
    one, other = to_the_end(whole), to_the_end(part)
    np.testing.assert_array_equal(one.seconds[3:], other.seconds)
    np.testing.assert_array_equal(one.override[3:], other.override)
