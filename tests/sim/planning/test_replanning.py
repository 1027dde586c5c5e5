"""The three roles do what they are named for when a person reaches into the visited."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.cells.cell import load_cell
from app.sim.collision.checker import Checker, Shapes, no_people, shapes_of
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.planning.ompl_planners import PLANNERS, PlanSettings
from app.sim.planning.path_tracking import PathFollower
from app.sim.planning.replanning import ROLES, ReplanningExecutor, ReplanningSettings
from app.sim.robot.kernels import acceleration_bounds
from app.sim.robot.kernels.joints import JointState
from app.sim.scene.scene import arm_of
from tests.sim.configurations import vertical_configuration
from tests.sim.mesh_reference import MeshReference

CELL = load_cell()
ARM = arm_of(CELL)
REPLANNING = ["replan-on-blocked", "replan-every-cycle"]
NO_PEOPLE = no_people()


def station(name: str) -> Vec:
    return vertical_configuration(ARM, np.array(CELL.station(name).position))[0]


def posture_at(palm: tuple[float, float, float]) -> Vec:
    rest = human.rest_posture(*CELL.human.home)
    return human.reach("r", np.array(palm), rest, CELL.body).q


def reaching_to(palm: tuple[float, float, float]) -> Shapes:
    return shapes_of(CELL, posture_at(palm)[None])


BLOCKING = reaching_to((-0.1, 0.7, 0.2))
AT_THE_GOAL = reaching_to((-0.5, 0.7, 0.2))


@dataclass
class Run:
    follower: ReplanningExecutor
    seconds: float
    least_m: float
    states: list[str]
    q: Vec
    visited: list[Vec]
    n_paths: int


def drive(
    role: str,
    people: Callable[[float], Shapes],
    planner: str = "rrt-connect",
    scale: Callable[[float], float] = lambda _: 1.0,
    limit_s: float = 10.0,
) -> Run:
    """From cube5 to cube0 with plans limited by poses; the limits are asserted throughout."""
    settings = ReplanningSettings(
        role=role, plan=PlanSettings(planner=planner, max_poses=6_000)
    )
    follower = ReplanningExecutor(ARM, station("cube0")[None], settings)
    q, qd, t, least = station("cube5"), np.zeros(6), 0.0, 9.0
    states, visited = [], []
    paths: list[PathFollower | None] = [None]
    c, q_out, qd_out = np.empty(6), np.empty(6), np.empty(6)
    while t < limit_s:
        wanted = follower.act(q, qd, people(t), t) * scale(t)
        states.append(follower.state)
        if follower.path_follower is not paths[-1]:
            paths.append(follower.path_follower)
        visited.append(q)
        if states[-1] == "arrived":
            break
        start = JointState(q, qd, np.zeros(6))
        acceleration_bounds.advance_to_speeds(
            ARM.limits, ARM.dt, start, wanted, c, JointState(q_out, qd_out, np.empty(6))
        )
        assert np.all(np.abs(qd_out) <= ARM.limits.qd_max + 1e-9)
        assert np.all(np.abs(2.0 * c) <= ARM.limits.qdd_max + 1e-9)
        q, qd, t = q_out.copy(), qd_out.copy(), t + ARM.dt
        least = min(least, Checker(ARM, people(t)).clearance(q).people_m)
    n_paths = sum(path is not None for path in paths)
    return Run(follower, t, least, states, q, visited, n_paths)


def from_time(start_s: float, shapes: Shapes, end_s: float = 99.0) -> Callable[[float], Shapes]:
    return lambda t: shapes if start_s <= t < end_s else NO_PEOPLE


@pytest.mark.parametrize("role", ROLES)
def test_every_role_arrives_in_an_empty_cell_in_the_same_time(role: str) -> None:
    run = drive(role, lambda _: NO_PEOPLE)
    assert run.states[-1] == "arrived"
    assert run.seconds == pytest.approx(drive("plan-once", lambda _: NO_PEOPLE).seconds)
    np.testing.assert_allclose(run.q, station("cube0"), atol=1e-3)
    assert run.follower.error_rad < 1e-9


def test_plan_once_ignores_people_that_arrive_later() -> None:
    run = drive("plan-once", from_time(0.3, BLOCKING))
    assert run.states[-1] == "arrived"
    assert run.follower.n_plans == 1
    assert run.least_m < 0.0


@pytest.mark.parametrize("role", REPLANNING)
@pytest.mark.parametrize("planner", PLANNERS)
def test_replanning_roles_go_round_a_person_who_comes(role: str, planner: str) -> None:
    run = drive(role, from_time(0.3, BLOCKING), planner)
    assert run.states[-1] == "arrived"
    assert run.n_paths >= 2
    assert run.least_m > run.follower.settings.margin
    assert "braking" in run.states


@pytest.mark.parametrize("role", REPLANNING)
def test_the_motion_driven_is_free_for_the_reference_on_raw_meshes(role: str) -> None:
    run, reference = drive(role, from_time(0.3, BLOCKING)), MeshReference(CELL)
    human_q = posture_at((-0.1, 0.7, 0.2))
    for before, after in itertools.pairwise(run.visited):
        for s in (0.0, 0.25, 0.5, 0.75):
            assert reference.contacts(before + s * (after - before), human_q) == []


def test_when_blocked_plans_only_when_blocked() -> None:
    run = drive("replan-on-blocked", from_time(0.3, BLOCKING))
    assert run.follower.n_plans <= 4
    assert drive("replan-on-blocked", lambda _: NO_PEOPLE).follower.n_plans == 1


def test_every_tick_plans_in_every_period() -> None:
    run = drive("replan-every-cycle", lambda _: NO_PEOPLE)
    assert run.follower.n_plans >= len(run.states) - 1


@pytest.mark.parametrize("role", REPLANNING)
def test_a_blocked_goal_makes_them_brake_say_so_and_go_on_when_it_is_free(role: str) -> None:
    run = drive(role, from_time(0.3, AT_THE_GOAL, 4.0))
    during = run.states[int(1.0 / ARM.dt) : int(4.0 / ARM.dt)]
    assert set(during) == {"braking"}
    assert run.states[-1] == "arrived" and run.seconds > 4.0
    still = drive(role, from_time(0.3, AT_THE_GOAL), limit_s=3.0)
    assert still.follower.outcome == "goal-in-contact"
    assert still.states[-1] == "braking"


@pytest.mark.parametrize("role", ROLES)
def test_without_a_plan_the_robot_rests_and_says_why(role: str) -> None:
    run = drive(role, lambda _: AT_THE_GOAL, limit_s=1.0)
    assert set(run.states) == {"waiting"}
    assert run.follower.outcome == "goal-in-contact"
    np.testing.assert_array_equal(run.q, station("cube5"))


def test_plan_once_avoids_people_present_at_the_start() -> None:
    run = drive("plan-once", lambda _: BLOCKING)
    assert run.states[-1] == "arrived"
    assert run.least_m > run.follower.settings.margin


@pytest.mark.parametrize("role", ROLES)
def test_a_layer_that_slows_and_stops_the_robot_does_not_lose_it(role: str) -> None:
    def halting(t: float) -> float:
        return 0.0 if 1.0 <= t < 1.6 else 0.6 if t < 2.5 else 1.0

    run = drive(role, lambda _: BLOCKING, scale=halting)
    assert run.states[-1] == "arrived"
    assert run.least_m > run.follower.settings.margin - 0.005
    assert run.follower.error_rad < 5e-3


@pytest.mark.parametrize("role", REPLANNING)
def test_from_within_the_margin_it_may_leave_with_an_eased_margin(role: str) -> None:
    near = reaching_to((0.5, 0.85, 0.3))
    clearance = Checker(ARM, near).clearance(station("cube5")).people_m
    assert 0.0 < clearance < 0.05
    run = drive(role, lambda _: near)
    assert run.states[-1] == "arrived"
    assert run.least_m > 0.0


def test_a_robot_pushed_off_its_path_is_lost_and_planned_for_again() -> None:
    settings = ReplanningSettings(role="replan-on-blocked", plan=PlanSettings(max_poses=3_000))
    follower = ReplanningExecutor(ARM, station("cube0")[None], settings)
    q, qd = station("cube5"), np.zeros(6)
    follower.act(q, qd, NO_PEOPLE, 0.0)
    pushed = q - np.array([0.3, 0.3, 0.0, 0.0, 0.0, 0.0])
    follower.act(pushed, qd, NO_PEOPLE, ARM.dt)
    assert follower.state == "lost"
    for k in range(2, 14):
        follower.act(pushed, qd, NO_PEOPLE, k * ARM.dt)
    assert follower.state == "following"
    assert follower.n_plans == 2


def test_an_unknown_role_is_named() -> None:
    with pytest.raises(InvalidInput, match="replan-every-cycle"):
        ReplanningExecutor(ARM, np.zeros((1, 6)), ReplanningSettings(role="sometimes"))
