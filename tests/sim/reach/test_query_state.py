"""A state in a request is observed as in training."""

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.human.person import Person
from app.sim.people.kernels.pedestrian import (
    AGE,
    GROWTH,
    PAST_RADIUS,
    PAST_SPEED,
    VX,
    VY,
    R,
    X,
    Y,
)
from app.sim.perception.observed_people import person_from_cylinder
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.query_state import QueryState
from app.sim.robot.measured_state import Joints
from app.sim.scene.scene import capsule_speeds_of, people_geometry_of
from tests.sim.driven_batches import drive

CELL = load_cell("shared-workspace")


def driven(people: tuple[str, ...], view: str) -> ReachBatch:
    settings = ReachSettings(people=people, observation=view)
    return drive(ReachBatch(CELL, 5, 2, settings), 20, seed=8)


def people_of(batch: ReachBatch, e: int) -> list[Person]:
    rows = batch.state.people
    bodies = [Person(q=q, qd=qd) for q, qd in zip(rows.q[e], rows.qd[e], strict=True)]
    walkers = []
    for row in rows.walkers.rows[e]:
        assert row[AGE] == 0.0  # or the last moment remembered is not now
        past = np.stack([row[PAST_RADIUS:PAST_SPEED], row[PAST_SPEED:]], axis=1)[1:]
        walkers.append(person_from_cylinder(*row[[X, Y, VX, VY, R, GROWTH]], past=past))
    return bodies + walkers


def test_shapes_have_the_speeds_of_capsules() -> None:
    batch = driven(("worker", "worker", "walker"), "forecast")
    query, rows = QueryState(CELL, 2, 1, "forecast"), batch.state.people
    shared, fastest = query.world.people, 0.0
    for e in range(5):
        state = batch.state
        robot = Joints(state.q[e], state.qd[e], np.zeros(6))
        query.load(robot, people_of(batch, e), state.time_left[e])
        placed = people_geometry_of(shared, rows.q[e], np.zeros((0, 3)))
        shapes = query.shapes
        np.testing.assert_array_equal(shapes.capsules, placed.capsules)
        speeds = capsule_speeds_of(shared, placed, rows.q[e], rows.qd[e])
        np.testing.assert_array_equal(shapes.speed, speeds)
        fastest = max(fastest, speeds.max())
    assert fastest > 0.1


@pytest.mark.parametrize("view", ["features", "state", "forecast"])
@pytest.mark.parametrize("people", [(), ("walker",), ("worker", "walker", "constant")])
def test_observations_and_distances_are_those_of_the_batch(
    people: tuple[str, ...], view: str
) -> None:
    batch, n_bodies = driven(people, view), people.count("worker")
    query = QueryState(CELL, n_bodies, len(people) - n_bodies, view)
    rows, state = np.arange(5), batch.state
    goals = np.random.default_rng(4).uniform(-1, 1, (5, 3, 3))
    for who in (None, *range(len(people))):
        expected = batch.observe_goals(rows, goals, who)
        for e in rows:
            query.load(
                Joints(state.q[e], state.qd[e], np.zeros(6)),
                people_of(batch, e),
                state.time_left[e],
            )
            found = query.observe(goals[e], who)
            np.testing.assert_allclose(found, expected[e], atol=2e-7)
            np.testing.assert_allclose(query.clear, state.clear[e], atol=1e-12)
    np.testing.assert_allclose(
        query.distances, batch.person_distances(np.array([4]))[0], atol=1e-12
    )


def test_what_is_not_remembered_was_as_the_oldest_that_is() -> None:
    query, q, goal = (
        QueryState(CELL, 0, 1, "forecast"),
        np.array(CELL.robot.home_q),
        [[0, 0.8, 1.0]],
    )
    seen = {}
    for name, past in {
        "nothing": None,
        "no moment": np.zeros((0, 2)),
        "always so": np.full((15, 2), [0.3, 0.5]),
        "grew": np.array([[0.25, 0.5], [0.2, 0.5]]),
        "grew long ago": np.array([[0.25, 0.5], *[[0.2, 0.5]] * 14]),
    }.items():
        person = person_from_cylinder(0.1, 1.4, 0.3, 0.4, 0.3, 0.0, past)
        query.load(Joints(q, np.zeros(6), np.zeros(6)), [person], 5.0)
        seen[name] = query.observe(np.array(goal)).copy()
    np.testing.assert_array_equal(seen["nothing"], seen["no moment"])
    np.testing.assert_array_equal(seen["nothing"], seen["always so"])
    np.testing.assert_array_equal(seen["grew"], seen["grew long ago"])
    assert np.abs(seen["grew"] - seen["nothing"]).max() > 0.05


def test_a_persons_own_size_counts() -> None:
    query, q = QueryState(CELL, 1, 0, "features"), np.array(CELL.robot.home_q)
    batch = driven(("worker",), "features")
    (one,) = people_of(batch, 0)
    query.load(Joints(q, np.zeros(6), np.zeros(6)), [one], 5.0)
    ordinary = query.distances[0]
    large = Person(q=one.q, qd=one.qd, size=CELL.body * 1.3)
    query.load(Joints(q, np.zeros(6), np.zeros(6)), [large], 5.0)
    assert query.distances[0] != ordinary


def test_shapes_are_the_people_with_the_height_of_the_cell() -> None:
    query = QueryState(CELL, 0, 2, "state")
    people = [
        person_from_cylinder(0.1, 1.2, 0.0, 0.0, 0.3),
        person_from_cylinder(-1.0, 1.5, 0.0, 0.0, 0.4),
    ]
    query.load(Joints(np.array(CELL.robot.home_q), np.zeros(6), np.zeros(6)), people, 5.0)
    top = CELL.floor_z + CELL.cylinders[0].height
    np.testing.assert_allclose(
        query.shapes.cylinders, [[0.1, 1.2, 0.3, top], [-1.0, 1.5, 0.4, top]]
    )
