"""Selection of the observed person: the rule of the batches, on single states."""

from dataclasses import replace

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.cells.cell import load_cell
from app.sim.collision.contact import clearance
from app.sim.human import model as human
from app.sim.human.anthropometry import percentile_body
from app.sim.human.person import Person
from app.sim.people.kernels.pedestrian import VX, VY, X, Y
from app.sim.perception.observed_people import (
    checked_people,
    nearest_index,
    people_shapes,
    person_anywhere,
    person_from_cylinder,
)
from app.sim.pick.batch import PickBatch, PickSettings
from app.sim.pick.candidate_observer import CandidateObserver
from app.sim.pick.kernels.observation_layout import N_FEATURES
from app.sim.scene.scene import NO_CYLINDERS, arm_of, people_of

CELL = load_cell()
ARM, PEOPLE = arm_of(CELL), people_of(CELL)
HOME = np.array(CELL.robot.home_q)


def standing(x: float, y: float) -> Person:
    return Person(q=human.rest_posture(x, y, -1.57), qd=np.zeros(18))


def test_the_person_seen_is_the_one_a_batch_sees() -> None:
    settings = PickSettings(people=("worker", "worker", "walker"))
    batch = PickBatch(CELL, 40, 6, settings)
    obs = batch.reset().copy()
    state, seen, observer = batch.state, set(), CandidateObserver(CELL)
    for e in range(40):
        walker = state.people.walkers.rows[e, 0]
        x, y, r = state.people.cylinders[e, 0]
        assert (x, y) == (walker[X], walker[Y])
        people = [
            *(
                Person(
                    q=state.people.q[e, w],
                    qd=state.people.qd[e, w],
                    size=state.people.size[e, w],
                )
                for w in range(2)
            ),
            person_from_cylinder(x, y, walker[VX], walker[VY], r),
        ]
        index = nearest_index(batch.arm, batch.world.people, state.q[e], people)
        assert index is not None
        seen.add(index)
        size = people[index].size
        found, _ = observer.observe(
            (state.q[e], state.qd[e]),
            (
                people[index].q[None],
                people[index].qd[None],
                batch.world.people.bodies if size is None else size[None],
            ),
            state.goal[e][None],
            state.time_left[e],
        )
        assert found.shape == (1, N_FEATURES)
        np.testing.assert_allclose(found[0], obs[e], atol=1e-5)
    assert seen == {0, 1, 2}


def test_nearest_is_by_distance_of_capsules_in_any_order() -> None:
    people = [standing(x, y) for x, y in ((0.0, 1.9), (0.7, 1.0), (-1.5, 1.2), (3.0, 3.0))]
    gaps = [clearance(ARM, PEOPLE, HOME, p.q[None], NO_CYLINDERS).people_m for p in people]
    for order in ([0, 1, 2, 3], [3, 2, 1, 0], [1, 3, 0, 2]):
        found = nearest_index(ARM, PEOPLE, HOME, [people[i] for i in order])
        assert found is not None and order[found] == int(np.argmin(gaps))


def test_size_counts_for_who_is_nearest() -> None:
    wide = percentile_body(95.0, 95.0, 95.0).vector(CELL.floor_z)
    narrow = percentile_body(5.0, 5.0, 5.0).vector(CELL.floor_z)
    people = [replace(standing(0.3, 1.2), size=size) for size in (narrow, wide)]
    assert nearest_index(ARM, PEOPLE, HOME, people) == 1
    assert nearest_index(ARM, PEOPLE, HOME, people[::-1]) == 0


def test_an_empty_cell_has_no_observed_person_and_a_single_person_is_always_observed() -> None:
    assert nearest_index(ARM, PEOPLE, HOME, []) is None
    assert nearest_index(ARM, PEOPLE, HOME, [standing(4.0, 4.0)]) == 0


def test_a_person_in_a_cylinder_faces_the_robot_and_has_its_velocity() -> None:
    person = person_from_cylinder(0.5, 1.0, 0.2, -0.3, 0.4)
    facing = np.array([np.cos(person.q[2]), np.sin(person.q[2])])
    np.testing.assert_allclose(facing, -person.q[:2] / np.linalg.norm(person.q[:2]))
    np.testing.assert_array_equal(person.qd[:3], [0.2, -0.3, 0.0])


@pytest.mark.parametrize(
    ("people", "field"),
    [
        ([standing(0.0, 1.0)] * 5, "people"),
        ([standing(0.0, 1.0), standing(101.0, 1.0)], "people[1].q[0]"),
        ([replace(standing(0.0, 1.0), qd=np.full(18, np.nan))], "people[0].qd[0]"),
        ([replace(standing(0.0, 1.0), size=np.ones(11))], "people[0].size"),
        ([replace(standing(0.0, 1.0), size=np.zeros(12))], "people[0].size[1]"),
        ([person_from_cylinder(0.0, 1.0, 0.0, 0.0, 0.0)], "people[0].cylinder[2]"),
    ],
)
def test_people_who_cannot_be_are_refused_by_name(people: list[Person], field: str) -> None:
    with pytest.raises(InvalidInput) as refused:
        checked_people(people)
    assert refused.value.field == field


@pytest.mark.parametrize("height", [0.0, -0.6])
def test_an_unknown_person_reaches_over_the_robot_in_any_cell(height: float) -> None:
    low = PEOPLE._replace(top_z=height)
    assert people_shapes(low, [person_anywhere()]).cylinders[0, 3] > 2.0
    person = person_from_cylinder(0.0, 1.0, 0.0, 0.0, 0.3)
    assert people_shapes(low, [person]).cylinders[0, 3] == height
    assert people_shapes(low, [replace(person, top=0.0)]).cylinders[0, 3] == 0.0
