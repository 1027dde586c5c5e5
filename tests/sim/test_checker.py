"""What planners ask about collisions agrees with distances and refuses bad shapes."""

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim import human
from app.sim.cells import load_cell
from app.sim.checker import Checker, no_people, shapes_of
from app.sim.kernels import arm as arm_kernel
from app.sim.pick import arm_of

CELL = load_cell()
ARM = arm_of(CELL)


def test_clearance_to_a_person_is_that_of_the_contact_test() -> None:
    rng = np.random.default_rng(0)
    pose = arm_kernel.new_pose(len(ARM.link))
    for _ in range(50):
        human_q = human.rest_posture(rng.uniform(-0.5, 0.5), rng.uniform(0.9, 1.5), -1.57)
        q = ARM.home + rng.uniform(-0.8, 0.8, 6)
        arm_kernel.place(ARM, q, human_q, pose)
        expected = arm_kernel.human_clearance(ARM, pose)[0]
        checker = Checker(ARM, shapes_of(CELL, human_q[None]))
        assert checker.clearance(q).people == pytest.approx(expected, abs=1e-12)


def test_two_people_of_different_kinds_both_count() -> None:
    rest = human.rest_posture(0.0, 1.2, -1.57)[None]
    tube = np.array([[0.6, 0.9, 0.2, 1.0]])
    alone = [
        Checker(ARM, shapes_of(CELL, rest, None)).clearance(ARM.home).people,
        Checker(ARM, shapes_of(CELL, None, tube)).clearance(ARM.home).people,
    ]
    both = Checker(ARM, shapes_of(CELL, rest, tube)).clearance(ARM.home).people
    assert alone[0] != alone[1]
    assert both == min(alone)


def test_a_pose_is_free_up_to_its_margin_and_not_beyond() -> None:
    people = shapes_of(CELL, human.rest_posture(0.0, 1.3, -1.57)[None])
    d = Checker(ARM, people).clearance(ARM.home).people
    assert Checker(ARM, people, d - 0.001).is_free(ARM.home)
    assert not Checker(ARM, people, d).is_free(ARM.home)


def test_an_empty_cell_is_infinitely_far_from_people() -> None:
    assert Checker(ARM, no_people()).clearance(ARM.home).people == 1e3


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
