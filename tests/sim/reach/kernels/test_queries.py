"""Observations for other goals and beside one person alone equal the ordinary ones."""

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.cells.cell import load_cell
from app.sim.collision import contact
from app.sim.people.kernels.people import nearest_person
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.kernels.observation import LAYOUT

CROWD = ("worker", "walker", "constant")


def batch_of(people: tuple[str, ...], observation: str, n_envs: int = 8) -> ReachBatch:
    """A batch some periods into its episodes."""
    settings = ReachSettings(people=people, observation=observation)
    batch = ReachBatch(load_cell("shared-workspace"), n_envs, 31, settings)
    batch.reset()
    rng = np.random.default_rng(32)
    for _ in range(30):
        batch.step(rng.uniform(-1, 1, (n_envs, 6)).astype(np.float32), auto_reset=False)
    return batch


def ordinary(batch: ReachBatch) -> np.ndarray:
    return batch.step(np.zeros((batch.n_envs, 6), dtype=np.float32)).obs.copy()


def all_envs(batch: ReachBatch) -> np.ndarray:
    return np.arange(batch.n_envs)


@pytest.mark.parametrize("observation", ["features", "state"])
@pytest.mark.parametrize("people", [(), ("walker",), ("worker",), CROWD])
def test_for_the_same_goal_they_are_the_ordinary_bits(
    people: tuple[str, ...], observation: str
) -> None:
    batch = batch_of(people, observation)
    obs, rows = ordinary(batch), all_envs(batch)
    found = batch.observe_goals(rows, batch.state.goal[:, None])
    np.testing.assert_array_equal(found[:, 0], obs)


@pytest.mark.parametrize("observation", ["features", "state"])
def test_for_other_goals_they_are_those_after_setting_them(observation: str) -> None:
    batch = batch_of(("walker", "constant"), observation)
    rows, own_goals = all_envs(batch), batch.state.goal.copy()
    goals = np.random.default_rng(5).uniform(-1, 1, (len(rows), 3, 3))
    found = batch.observe_goals(rows, goals)
    np.testing.assert_array_equal(batch.state.goal, own_goals)
    for k in range(3):
        np.testing.assert_array_equal(batch.set_goals(rows, goals[:, k]), found[:, k])


@pytest.mark.parametrize("observation", ["features", "state"])
@pytest.mark.parametrize("kind", ["walker", "worker"])
def test_beside_the_only_person_they_are_the_ordinary_bits(kind: str, observation: str) -> None:
    batch = batch_of((kind,), observation)
    obs, rows = ordinary(batch), all_envs(batch)
    found = batch.observe_goals(rows, batch.state.goal[:, None], person=0)
    np.testing.assert_array_equal(found[:, 0], obs)


@pytest.mark.parametrize("who", range(3))
def test_beside_one_of_several_only_that_person_counts(who: int) -> None:
    batch = batch_of(CROWD, "features")
    obs, rows = ordinary(batch), all_envs(batch)
    alone = batch.observe_goals(rows, batch.state.goal[:, None], who)[:, 0]
    # All others leave; the remaining person is then observed as usual.
    people = batch.state.people
    for worker in {0} - {who}:
        people.q[:, worker, 0] = 900.0
    for k in {0, 1} - {who - 1}:
        people.walkers.rows[:, k, 0] = 900.0
        people.cylinders[:, k, 0] = 900.0
    found = batch.observe_goals(rows, batch.state.goal[:, None])[:, 0]
    others = np.ones(batch.obs_size, dtype=bool)
    others[LAYOUT["clearance"]] = False
    np.testing.assert_array_equal(alone[:, others], found[:, others])
    gaps = batch.person_distances(rows)[:, who]
    expected = np.minimum(3.0, gaps / 0.5).astype(np.float32)
    np.testing.assert_array_equal(alone[:, LAYOUT["clearance"]][:, 0], expected)
    assert not np.array_equal(alone, obs)


def test_distances_are_those_to_each_person_and_the_nearest_is_the_least() -> None:
    batch = batch_of(CROWD, "features")
    state, people = batch.state, batch.world.people
    found = batch.person_distances(all_envs(batch))
    for e in all_envs(batch):
        to_worker = contact.clearance(
            batch.arm,
            people,
            state.q[e],
            state.people.q[e],
            np.zeros((0, 3)),
            state.people.size[e],
        )
        to_walkers = [
            contact.clearance(batch.arm, people, state.q[e], np.zeros((0, 18)), row[None])
            for row in state.people.cylinders[e]
        ]
        expected = [to_worker.people_m, *(one.people_m for one in to_walkers)]
        np.testing.assert_allclose(found[e], expected, atol=1e-12)
        batch.observe_goals(np.array([e]), state.goal[e : e + 1, None])
        work = batch._observation_work
        near = nearest_person(people, work.robot.capsules, work.geometry)
        assert near == int(np.argmin(found[e]))


@pytest.mark.parametrize(
    ("rows", "goals", "who"),
    [
        ([0, 8], (2, 1, 3), None),
        ([-1], (1, 1, 3), None),
        ([0], (2, 1, 3), None),
        ([0], (1, 3), None),
        ([0], (1, 1, 3), 3),
        ([0], (1, 1, 3), -1),
    ],
)
def test_cells_people_and_shapes_that_are_not_there_are_refused(
    rows: list[int], goals: tuple[int, ...], who: int | None
) -> None:
    batch = batch_of(CROWD, "state")
    with pytest.raises(InvalidInput):
        batch.observe_goals(np.array(rows), np.zeros(goals), who)
