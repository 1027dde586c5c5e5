"""The recheck finds what asking the meshes in every row finds."""

from dataclasses import replace

import fcl
import numpy as np

from app.sim.cells.cell import Cell, load_cell
from app.sim.collision.fcl_recheck import (
    Recheck,
    Trajectory,
    segment_distances,
)
from app.sim.collision.fcl_reference import BODY_NAMES, make_capsule
from app.sim.human import model as human
from app.sim.human.anthropometry import percentile_body
from app.sim.robot.ur10 import Robot
from tests.sim.mesh_reference import MeshReference


def random_trajectory(cell: Cell, rng: np.random.Generator, n_steps: int) -> Trajectory:
    """A straight joint move between two stations while the person moves between two reaches."""
    limits = np.array(cell.robot.q_min), np.array(cell.robot.q_max)
    stations = rng.choice(len(cell.stations), 4)
    start, end, *reaches = (np.array(cell.stations[one].position) for one in stations)
    robot, rest = Robot(), human.rest_posture(*cell.human.home)
    q0, q1 = robot.ik_vertical(start, *limits), robot.ik_vertical(end, *limits)
    assert q0 is not None and q1 is not None
    h0, h1 = (human.reach("r", p + [0, 0.1, 0.1], rest, cell.body).q for p in reaches)
    w = np.linspace(0.0, 1.0, n_steps)[:, None]
    return Trajectory(q_robot=q0 + w * (q1 - q0), q_human=h0 + w * (h1 - h0))


def test_first_contact_is_that_of_asking_the_meshes_in_every_row() -> None:
    cell, rng = load_cell(), np.random.default_rng(21)
    trajectories = [random_trajectory(cell, rng, 60) for _ in range(12)]
    reference, expected = MeshReference(cell), []
    for path in trajectories:
        touching = (
            index
            for index, (q, human_q) in enumerate(zip(path.q_robot, path.q_human, strict=True))
            if reference.contacts(q, human_q)
        )
        expected.append(next(touching, None))
    recheck = Recheck(cell)
    found = [recheck.first_contact(path) for path in trajectories]
    assert [hit.index if hit else None for hit in found] == expected
    assert None in expected and any(expected)


def test_contact_with_table_and_self_are_found_without_a_person_nearby() -> None:
    cell = load_cell()
    away = np.tile(human.rest_posture(0.0, 1.6, -1.57), (2, 1))
    home, flat = np.array(cell.robot.home_q), np.array([1.5, 0.1, 0.0, 0.0, 0.0, 0.0])
    path = Trajectory(q_robot=np.array([home, flat]), q_human=away)
    hit = Recheck(cell).first_contact(path)
    assert hit is not None and hit.index == 1
    assert {contact.kind for contact in hit.contacts} >= {"cell"}


def test_contact_of_a_person_of_another_size_is_found() -> None:
    cell = load_cell()
    home, tall = np.array(cell.robot.home_q), percentile_body(99.0, 90.0).vector(cell.floor_z)
    at_tool = np.array([0.0, 0.34, 0.58])
    q = human.reach("r", at_tool, human.rest_posture(*cell.human.home), tall).q
    path = Trajectory(q_robot=np.tile(home, (3, 1)), q_human=np.tile(q, (3, 1)))
    recheck = Recheck(cell)
    assert recheck.first_contact(path) is None
    sizes = np.stack([cell.body, tall, tall])
    hit = recheck.first_contact(replace(path, sizes=sizes))
    assert hit is not None and hit.index == 1
    assert {contact.body for contact in hit.contacts} <= {"hand_r", "forearm_r"}


def test_segment_distances_equal_those_of_fcl() -> None:
    rng = np.random.default_rng(22)
    a0, a1, b0, b1 = rng.uniform(-0.5, 0.5, (4, 500, 3))
    b1[:100] = b0[:100] + 0.7 * (a1 - a0)[:100]
    request = fcl.DistanceRequest(gjk_solver_type=fcl.GJKSolverType.GST_INDEP)
    gaps = segment_distances(a0, a1, b0, b1)
    for k in np.flatnonzero(gaps > 0.03):
        one, two = make_capsule(0.01, a0[k], a1[k]), make_capsule(0.01, b0[k], b1[k])
        distance = fcl.distance(one, two, request, fcl.DistanceResult())
        assert abs(distance - (gaps[k] - 0.02)) < 1e-6


def walked_into(x: np.ndarray, radius: float) -> Trajectory:
    """The robot at home, and a cylinder that comes along x at the robot's y."""
    home = np.array(load_cell("shared-workspace").robot.home_q)
    cylinders = np.stack([x, np.zeros(len(x)), np.full(len(x), radius)], axis=1)[:, None]
    return Trajectory(
        q_robot=np.tile(home, (len(x), 1)),
        q_human=np.tile(human.rest_posture(0.0, 4.0, -1.57), (len(x), 1)),
        cylinders=cylinders,
    )


def test_first_contact_of_a_cylinder_is_that_of_asking_the_meshes_in_every_row() -> None:
    cell = load_cell("shared-workspace")
    path = walked_into(np.linspace(1.6, 0.1, 60), 0.3)
    reference, touching = MeshReference(cell), []
    reference.place_robot(path.q_robot[0])
    for row in path.walkers:
        reference.place_walkers(row)
        touching.append(any(reference.touching(link, "walker 0") for link in BODY_NAMES))
    hit = Recheck(cell).first_contact(path)
    assert hit is not None and hit.index == touching.index(True) > 10
    assert {(contact.kind, contact.body) for contact in hit.contacts} == {("human", "walker 0")}


def test_contact_with_the_second_of_two_cylinders_is_found() -> None:
    path = walked_into(np.linspace(3.0, 0.1, 30), 0.3)
    away = path.walkers + [0.0, 3.0, 0.0]
    alone = Recheck(load_cell("shared-workspace")).first_contact(path)
    both = replace(path, cylinders=np.concatenate([away, path.walkers], axis=1))
    hit = Recheck(load_cell("shared-workspace")).first_contact(both)
    assert alone is not None and hit is not None and hit.index == alone.index
    assert {contact.body for contact in hit.contacts} == {"walker 1"}


def test_a_cylinder_counts_only_as_high_as_it_is() -> None:
    cell = load_cell("shared-workspace")
    low = cell.cylinders[0].model_copy(update={"height": 0.5})  # below the table
    short = cell.model_copy(update={"people": (low,)})
    path = walked_into(np.array([0.1]), 0.3)
    assert Recheck(cell).first_contact(path) is not None
    assert Recheck(short).first_contact(path) is None
