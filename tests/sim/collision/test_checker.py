"""What planners ask about collisions agrees with distances and refuses bad shapes."""

import fcl
import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.cells.cell import load_cell
from app.sim.cells.parts import Obstacle
from app.sim.collision.checker import Checker, no_people, shapes_of
from app.sim.collision.fcl_reference import make_capsule
from app.sim.core.arrays import Vec
from app.sim.geometry.capsules import RADIUS, ends_of
from app.sim.human import model as human
from app.sim.robot.kernels import arm as arm_kernel
from app.sim.scene.scene import arm_of

CELL = load_cell()
ARM = arm_of(CELL)


def fcl_distance(q: Vec, human_q: Vec, tube: Vec) -> float:
    """Distance of the robot's capsules to a person's capsules and a cylinder [m], by fcl."""
    pose = arm_kernel.new_robot_pose(ARM)
    arm_kernel.place_robot(ARM, q, pose)
    robot = ends_of(pose.capsules, len(ARM.link))
    radii = ARM.capsules[RADIUS, : len(ARM.link)]
    low = CELL.floor_z - 1.0
    centre = np.array([tube[0], tube[1], 0.5 * (tube[3] + low)])
    shape = fcl.Cylinder(tube[2], tube[3] - low)
    others = [fcl.CollisionObject(shape, fcl.Transform(centre))]
    ends = human.capsules(human_q, CELL.body, CELL.floor_z)
    for radius, (p0, p1) in zip(human.CAPSULE_RADII, ends, strict=True):
        others.append(make_capsule(float(radius), p0, p1))
    links = [make_capsule(float(r), *e) for r, e in zip(radii, robot, strict=True)]
    return min(fcl.distance(link, other) for link in links for other in others)


def test_clearance_to_people_is_that_of_fcl_on_the_same_shapes() -> None:
    rng, apart = np.random.default_rng(0), 0
    for _ in range(100):
        human_q = human.rest_posture(rng.uniform(-0.5, 0.5), rng.uniform(0.9, 1.5), -1.57)
        tube = np.array([*rng.uniform([-0.8, 0.6], [0.8, 1.2]), 0.15, rng.uniform(0.2, 0.9)])
        q = ARM.home + rng.uniform(-0.8, 0.8, 6)
        expected = fcl_distance(q, human_q, tube)
        found = Checker(ARM, shapes_of(CELL, human_q[None], tube[None])).clearance(q).people_m
        if expected > 0.0:
            apart += 1
            assert found == pytest.approx(expected, abs=1e-5)
        else:
            assert found <= 1e-6
    assert 20 < apart < 100


def test_fixed_obstacles_count() -> None:
    box = Obstacle(
        id="post", label="Post", center=(0.35, 0.5, 0.3), half_size=(0.05, 0.05, 0.3)
    )
    with_box = arm_of(CELL.model_copy(update={"obstacles": (box,)}))
    path = np.stack([ARM.home, ARM.home])
    path[0, 0], path[1, 0] = 0.0, 1.6
    path[:, 1] += 0.9
    assert Checker(ARM, no_people()).path_free(path)
    assert not Checker(with_box, no_people()).path_free(path)


def test_two_people_of_different_kinds_both_count() -> None:
    rest = human.rest_posture(0.0, 1.2, -1.57)[None]
    tube = np.array([[0.6, 0.9, 0.2, 1.0]])
    alone = [
        Checker(ARM, shapes_of(CELL, rest, None)).clearance(ARM.home).people_m,
        Checker(ARM, shapes_of(CELL, None, tube)).clearance(ARM.home).people_m,
    ]
    both = Checker(ARM, shapes_of(CELL, rest, tube)).clearance(ARM.home).people_m
    assert alone[0] != alone[1]
    assert both == min(alone)


def test_a_pose_is_free_up_to_its_margin_and_not_beyond() -> None:
    people = shapes_of(CELL, human.rest_posture(0.0, 1.3, -1.57)[None])
    d = Checker(ARM, people).clearance(ARM.home).people_m
    assert Checker(ARM, people, d - 0.001).is_free(ARM.home)
    assert not Checker(ARM, people, d).is_free(ARM.home)


def test_an_empty_cell_is_infinitely_far_from_people() -> None:
    assert Checker(ARM, no_people()).clearance(ARM.home).people_m == 1e3


def test_a_path_with_one_blocked_edge_is_not_free() -> None:
    low = ARM.home.copy()
    low[1] = 0.1
    checker = Checker(ARM, no_people())
    assert checker.path_free(np.stack([ARM.home, ARM.home + 0.05]))
    assert not checker.path_free(np.stack([ARM.home, ARM.home + 0.05, low]))


@pytest.mark.parametrize(
    "cylinders", [np.array([[0.0, np.nan, 0.2, 1.0]]), np.zeros((1, 3)), np.zeros(4)]
)
def test_bad_shapes_are_named(cylinders: np.ndarray) -> None:
    with pytest.raises(InvalidInput, match="cylinders"):
        shapes_of(CELL, None, cylinders)
