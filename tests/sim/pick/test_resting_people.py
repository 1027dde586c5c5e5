"""A planner moves the robot around people at rest, and only then."""

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.collision.checker import Checker, Shapes, no_people, shapes_of
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.pick.batch import step_robot, target_configurations
from app.sim.pick.kernels.grasp import APPROACH, DESCEND, LIFT, GraspRules
from app.sim.pick.resting_people import AT_REST, REST_S, PickTarget, RestingPeoplePlanner
from app.sim.scene.scene import arm_of
from tests.sim.configurations import vertical_configuration

CELL = load_cell()
ARM, GRASP = arm_of(CELL), GraspRules()


def station(name: str) -> Vec:
    return np.array(CELL.station(name).position)


def target(name: str, phase: int = APPROACH) -> PickTarget:
    over, low, reached = target_configurations(ARM, GRASP, station(name)[None])
    assert reached.all()
    return PickTarget(q_over=over[0], q_grasp=low[0], phase=phase)


def reaching_to(palm: tuple[float, float, float]) -> Shapes:
    rest = human.rest_posture(*CELL.human.home)
    posture = human.reach("r", np.array(palm), rest, CELL.body).q
    return shapes_of(CELL, posture[None])


BLOCKING = reaching_to((-0.1, 0.7, 0.2))
START = vertical_configuration(ARM, station("cube0"))[0]
GOAL = target("cube4")


def rested() -> RestingPeoplePlanner:
    planner = RestingPeoplePlanner(ARM)
    while not planner.note(0.0):
        pass
    return planner


def moved(planner: RestingPeoplePlanner, q: Vec, aim: PickTarget, people: Shapes) -> list[Vec]:
    """Configurations on the way from ``q`` until the robot stands at the target."""
    path, qd, qdd = [q], np.zeros(6), np.zeros(6)
    for _ in range(400):
        assert planner.note(0.0)
        act = planner.act(path[-1], qd, people, aim, GRASP)
        assert act is not None
        end = step_robot(ARM, path[-1], qd, qdd, act)
        path, qd, qdd = [*path, end.q], end.qd, end.qdd
        if np.abs(end.q - aim.q)[:5].max() < 1e-3 and np.abs(qd).max() < 1e-3:
            return path
    raise AssertionError("never there")


def test_robot_goes_around_a_person_who_blocks_the_straight_path() -> None:
    checker = Checker(ARM, BLOCKING)
    assert not checker.edge_free(START, GOAL.q_over)
    path = moved(rested(), START, GOAL, BLOCKING)
    assert min(checker.clearance(q).people_m for q in path) > 0.03


def test_all_phases_of_a_pick_are_planned() -> None:
    planner = rested()
    down = moved(planner, GOAL.q_over, target("cube4", DESCEND), BLOCKING)[-1]
    assert down == pytest.approx(GOAL.q_grasp, abs=1e-3)
    up = moved(planner, down, target("cube4", LIFT), BLOCKING)[-1]
    assert up == pytest.approx(GOAL.q_over, abs=1e-3)


def test_planner_waits_until_all_people_have_been_at_rest_for_a_while() -> None:
    planner, n = RestingPeoplePlanner(ARM), round(REST_S / ARM.dt)
    assert [planner.note(AT_REST) for _ in range(n)] == [False] * (n - 1) + [True]
    assert not planner.note(2.0 * AT_REST)
    assert not any(planner.note(0.0) for _ in range(n - 1))
    assert planner.note(0.0)
    assert not planner.note(np.inf)


def test_policy_acts_where_a_grasp_would_be_too_close_to_the_person() -> None:
    x, y, z = station("cube4")
    near = reaching_to((x, y + 0.05, z + 0.05))
    assert Checker(ARM, near).clearance(GOAL.q_grasp).people_m < GRASP.start_clearance
    assert rested().act(START, np.zeros(6), near, GOAL, GRASP) is None


def test_policy_acts_when_a_person_enters_the_path() -> None:
    planner = rested()
    first = planner.act(START, np.zeros(6), no_people(), GOAL, GRASP)
    assert first is not None and np.abs(first).max() > 0.0
    acts = []
    for _ in range(4):
        planner.note(0.0)
        acts.append(planner.act(START, np.zeros(6), BLOCKING, GOAL, GRASP))
    assert any(act is None for act in acts)


def test_blocked_targets_are_not_offered_but_the_begun_one_and_all_where_none_is_free() -> None:
    names = ("cube2", "cube4")
    x, y, z = station("cube4")
    near, planner = reaching_to((x, y + 0.05, z + 0.05)), rested()
    over, low, _ = target_configurations(ARM, GRASP, np.stack([station(one) for one in names]))

    def offered(first: int, begun: int | None = None) -> list[bool]:
        left = planner.offered(near, GRASP, over[first:], low[first:], begun)
        return [bool(one) for one in left]

    assert offered(0) == [True, False]
    assert offered(0, begun=1) == [True, True]
    assert offered(1) == [True]


def test_people_who_moved_are_checked_again() -> None:
    x, y, z = station("cube4")
    near, planner = reaching_to((x, y + 0.05, z + 0.05)), rested()
    ends = GOAL.q_over[None], GOAL.q_grasp[None]
    answers = [planner.free(people, GRASP, *ends)[0] for people in (near, no_people(), near)]
    assert answers == [False, True, False]


def test_targets_are_checked_again_under_rules_with_another_clearance() -> None:
    planner, (over, low, _) = (
        rested(),
        target_configurations(ARM, GRASP, station("cube4")[None]),
    )
    people = shapes_of(CELL, human.rest_posture(*CELL.human.home)[None])
    assert planner.free(people, GRASP, over, low).all()
    assert not planner.free(people, GRASP._replace(start_clearance=5.0), over, low).any()
    assert planner.free(people, GRASP, over, low).all()
