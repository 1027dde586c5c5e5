"""Tests of pick episodes: the observed person and recorded trajectories."""

from dataclasses import replace

import numpy as np
import pytest

from app.policies.checkpoints import pretrained
from app.policies.configs.pick import PickPreset
from app.policies.evaluation.pick import selection_rules
from app.policies.evaluation.pick.episodes import Evaluator, observe_exactly, settings_for
from app.policies.inference.task_selection import TaskChooser
from app.policies.inference.value_networks import ValueNetworks
from app.sim.cells.cell import load_cell
from app.sim.collision.contact import clearance
from app.sim.human import model as human
from app.sim.human.anthropometry import percentile_body
from app.sim.human.person import Person
from app.sim.people.human_motion_config import HumanMotionConfig, at_the_table
from app.sim.pick.batch import WHOLE_PICK, PickBatch, PickSettings
from app.sim.pick.task_policy import Candidate
from tests.sim.recorded_person import working
from tests.sim.working_people import run_of

NO_PEDESTRIANS = np.zeros((0, 3))


def test_the_nearest_of_several_workers_is_seen_in_their_own_size():
    batch = PickBatch(load_cell(), 40, 7, PickSettings(people=("worker",) * 3))
    batch.reset()
    rows, people, seen = np.arange(3, 40, 2), batch.state.people, set()
    observed = observe_exactly(batch, rows)
    for k, e in enumerate(rows):
        clearances = [
            clearance(
                batch.arm,
                batch.world.people,
                batch.state.q[e],
                q[None],
                NO_PEDESTRIANS,
                size[None],
            ).people_m
            for q, size in zip(people.q[e], people.size[e], strict=True)
        ]
        nearest = int(np.argmin(clearances))
        seen.add(nearest)
        others = [w for w in range(3) if w != nearest]
        np.testing.assert_array_equal(observed.q[k, 1:], people.q[e, others])
        np.testing.assert_array_equal(observed.q[k, 0], people.q[e, nearest])
        np.testing.assert_array_equal(observed.qd[k, 0], people.qd[e, nearest])
        np.testing.assert_array_equal(observed.size[k, 0], people.size[e, nearest])
    assert seen == {0, 1, 2}


def test_an_empty_cell_is_observed_as_a_person_far_away():
    batch = PickBatch(load_cell(), 2, 7, PickSettings(people=()))
    batch.reset()
    observed = observe_exactly(batch, np.arange(2))
    np.testing.assert_array_equal(observed.q, np.tile(batch.world.people.no_person, (2, 1, 1)))
    assert observed.q[0, 0, 1] > 3.0 and not observed.qd.any()


@pytest.mark.parametrize("workers", [1, 2])
def test_batch_evaluation_and_service_value_people_alike(workers):
    """Beside one person, and beside two; the second stands beyond 4 m."""
    checkpoint, cell, n = pretrained.load("pick"), load_cell(), 4
    networks, chooser = ValueNetworks(checkpoint), TaskChooser(checkpoint)
    settings = replace(WHOLE_PICK, people=("worker",) * workers, n_candidates=(2, 2))
    evaluator, views = Evaluator(networks, PickBatch(cell, n, 7, settings)), []

    def move_away(batch):
        batch.state.people.q[:, 1:] = human.rest_posture(2.4, 3.3, -2.0)

    def recorded(view):
        views.append(view.values)
        return selection_rules.fixed(0)(view)

    evaluator.run(recorded, start=move_away)
    batch = evaluator.batch
    state = batch.state
    batch.reset()
    move_away(batch)
    obs = batch._look(np.arange(n))
    np.testing.assert_allclose(networks.evaluate(obs)[1], views[0][:, 0], atol=1e-5)
    ids = [station.id for station in cell.pick_stations]
    for e in range(n):
        people = [
            Person(q=q, qd=qd, size=size)
            for q, qd, size in zip(
                state.people.q[e], state.people.qd[e], state.people.size[e], strict=True
            )
        ]
        offered = [
            Candidate(id=ids[k], position=batch.world.stations[k])
            for k in state.candidates[e, :2]
        ]
        decision = chooser.decide(
            state.q[e], state.qd[e], people, offered, time_left_s=state.time_left[e]
        )
        np.testing.assert_allclose(decision.values, views[0][e], atol=1e-5)


def test_an_angle_beyond_its_limit_is_observed_as_the_limit():
    cell, q = load_cell(), working(60)
    q[:, 13], q[:, 3] = 4.0, 0.3
    run = at_the_table(run_of(q), cell)
    work = HumanMotionConfig(motion="recorded", recorded=(run,))
    batch = PickBatch(cell, 3, 7, PickSettings(work=work))
    batch.reset()
    observed = observe_exactly(batch, np.arange(3))
    np.testing.assert_array_equal(observed.q[:, 0, 13], human.Q_MAX[13])
    others = np.delete(observed.q[:, 0], 13, axis=1)
    np.testing.assert_array_equal(others, np.delete(batch.state.people.q[:, 0], 13, axis=1))


@pytest.fixture(scope="module")
def two_sizes():
    bodies = (percentile_body(5.0), percentile_body(95.0))
    usual = settings_for((1, 1), PickPreset())
    settings = PickSettings(
        time_limit_s=usual.time_limit_s,
        people=("worker", "worker"),
        work=HumanMotionConfig(bodies=bodies),
    )
    networks = ValueNetworks(pretrained.load("pick"))
    evaluator = Evaluator(networks, PickBatch(load_cell(), 8, 3, settings))
    return evaluator, evaluator.run(selection_rules.fixed(0), n_recorded=6)


def test_each_worker_of_each_recorded_row_is_a_trajectory_in_their_size(two_sizes):
    evaluator, episodes = two_sizes
    sizes, found = evaluator.batch.state.people.size[:6].reshape(-1, 12), []
    for trajectory in episodes.trajectories:
        assert trajectory.sizes.shape == (len(trajectory.q_robot), 12)
        assert len(trajectory.q_human) == len(trajectory.q_robot)
        np.testing.assert_array_equal(trajectory.sizes, trajectory.sizes[:1].repeat(
            len(trajectory.sizes), axis=0))  # fmt: skip
        found.append(trajectory.sizes[0])
    assert 2 <= len(found) <= 12 and len(found) % 2 == 0
    assert all((np.abs(sizes - one).max(axis=1) == 0.0).any() for one in found)
    assert len({float(one[0]) for one in found}) == 2


def test_a_trajectory_is_the_path_of_its_worker(two_sizes):
    evaluator, episodes = two_sizes
    first, second = episodes.trajectories[:2]
    np.testing.assert_array_equal(first.q_robot, second.q_robot)
    assert not np.array_equal(first.q_human, second.q_human)
    steps = np.abs(np.diff(first.q_human, axis=0)).max()
    assert 0.0 < steps < 0.2
