"""Every planner finds free paths, says when it does not, and repeats itself by seed."""

import threading

import numpy as np
import pytest

from app.errors import InvalidInput, MissingPackage
from app.sim.cells.cell import load_cell
from app.sim.collision.checker import Checker, Shapes, no_people, shapes_of
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.planning import ompl_planners as planners
from app.sim.planning.goal_configurations import goal_configurations
from app.sim.planning.ompl_planners import PLANNERS, PlanSettings, path_length, plan
from app.sim.planning.time_parameterization import time_free_path
from app.sim.scene.scene import arm_of
from tests.sim.configurations import vertical_configuration
from tests.sim.mesh_reference import MeshReference

CELL = load_cell()
ARM = arm_of(CELL)
MARGIN = 0.05


def station(name: str) -> Vec:
    return vertical_configuration(ARM, np.array(CELL.station(name).position))[0]


def reaching_person() -> Vec:
    """A person whose hand lies on the straight joint motion from cube5 to cube0."""
    rest = human.rest_posture(*CELL.human.home)
    return human.reach("r", np.array([-0.1, 0.7, 0.2]), rest, CELL.body).q


def blocking_people() -> Shapes:
    return shapes_of(CELL, reaching_person()[None])


def ask(people: Shapes, settings: PlanSettings, seed: int = 1) -> planners.MotionPlan:
    return ask_with(Checker(ARM, people, MARGIN), settings, seed)


def ask_with(checker: Checker, settings: PlanSettings, seed: int = 1) -> planners.MotionPlan:
    return plan(checker, station("cube5"), station("cube0")[None], settings, seed)


@pytest.mark.parametrize("planner", PLANNERS)
def test_a_free_path_is_straight(planner: str) -> None:
    answer = ask(no_people(), PlanSettings(planner=planner))
    assert answer.solved
    np.testing.assert_array_equal(answer.path, [station("cube5"), station("cube0")])


@pytest.mark.parametrize("planner", PLANNERS)
def test_of_a_blocked_and_a_free_goal_the_shorter_path_counts(planner: str) -> None:
    goals = np.stack([station("cube0"), station("dock0")])
    checker = Checker(ARM, blocking_people(), MARGIN)
    answer = plan(
        checker, station("cube5"), goals, PlanSettings(planner=planner, max_poses=9_000)
    )
    assert answer.solved
    np.testing.assert_array_equal(answer.path, [station("cube5"), station("dock0")])
    far = goals[1] + np.array([0.0, 0.0, 0.0, 0.0, 2.2, 0.0])
    assert checker.edge_free(station("cube5"), far)
    goals[1] = far
    answer = plan(
        checker, station("cube5"), goals, PlanSettings(planner=planner, max_poses=9_000)
    )
    reached = goals[1 if planner == "rrt-connect" else 0]
    np.testing.assert_allclose(answer.path[-1, :5], reached[:5], atol=1e-6)


@pytest.mark.parametrize("planner", PLANNERS)
def test_a_path_round_a_person_is_free_for_the_reference_on_raw_meshes(planner: str) -> None:
    answer = ask(blocking_people(), PlanSettings(planner=planner, max_poses=20_000))
    assert answer.solved
    np.testing.assert_array_equal(answer.path[[0, -1]], [station("cube5"), station("cube0")])
    reference, human_q = MeshReference(CELL), reaching_person()
    for a, b in zip(answer.path[:-1], answer.path[1:], strict=True):
        for s in np.arange(0.0, 1.0, 0.02 / max(0.02, np.abs(b - a).max())):
            assert reference.contacts(a + s * (b - a), human_q) == []


def test_the_reference_sees_the_contact_that_the_path_avoids() -> None:
    reference, human_q = MeshReference(CELL), reaching_person()
    a, b = station("cube5"), station("cube0")
    straight = [a + s * (b - a) for s in np.linspace(0.0, 1.0, 60)]
    kinds = {c.kind for q in straight for c in reference.contacts(q, human_q)}
    assert kinds == {"human"}


@pytest.mark.parametrize("planner", ["rrt-star", "aorrtc"])
def test_more_looking_gives_shorter_paths_on_average(planner: str) -> None:
    def mean(poses: int) -> float:
        settings = PlanSettings(planner=planner, max_poses=poses)
        answers = [ask(blocking_people(), settings, seed) for seed in range(1, 7)]
        return float(np.mean([path_length(a.path) for a in answers if a.solved]))

    assert mean(40_000) < mean(4_000)


@pytest.mark.parametrize("planner", PLANNERS)
def test_the_same_seed_gives_the_same_path_whatever_was_planned_before(planner: str) -> None:
    settings = PlanSettings(planner=planner, max_poses=6_000)
    first = ask(blocking_people(), settings, seed=5)
    other = ask(blocking_people(), settings, seed=6)
    again = ask(blocking_people(), settings, seed=5)
    np.testing.assert_array_equal(first.path, again.path)
    assert first.path.shape != other.path.shape or np.abs(first.path - other.path).max() > 1e-3


def test_threads_do_not_disturb_each_other() -> None:
    settings = PlanSettings(max_poses=4_000)
    alone = [ask(blocking_people(), settings, seed).path for seed in (1, 2)]
    beside: dict[int, Vec] = {}

    def work(seed: int) -> None:
        beside[seed] = ask(blocking_people(), settings, seed).path

    threads = [threading.Thread(target=work, args=(seed,)) for seed in (1, 2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for seed, path in zip((1, 2), alone, strict=True):
        np.testing.assert_array_equal(beside[seed], path)


@pytest.mark.parametrize("planner", PLANNERS)
def test_no_budget_is_said_and_no_more_is_looked_at(planner: str) -> None:
    checker = Checker(ARM, blocking_people(), MARGIN)
    answer = ask_with(checker, PlanSettings(planner=planner, max_poses=10))
    assert answer.outcome in ("out-of-time", "approximate")
    assert checker.n_poses < 200


@pytest.mark.parametrize("planner", PLANNERS)
def test_an_unreachable_goal_ends_with_the_budget(
    planner: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(planners, "DETOUR_RAD", 0.0)
    checker = Checker(ARM, blocking_people(), MARGIN)
    answer = ask_with(checker, PlanSettings(planner=planner, budget_s=0.1))
    assert answer.outcome in ("out-of-time", "approximate")
    assert checker.n_poses > 100


def test_start_and_goal_in_contact_have_names() -> None:
    tool = np.array(CELL.station("cube5").position)
    at_start = shapes_of(CELL, None, np.array([[tool[0], tool[1], 0.1, 0.5]]))
    assert ask(at_start, PlanSettings()).outcome == "start-in-contact"
    tool = np.array(CELL.station("cube0").position)
    at_goal = shapes_of(CELL, None, np.array([[tool[0], tool[1], 0.1, 0.5]]))
    assert ask(at_goal, PlanSettings()).outcome == "goal-in-contact"


def test_outside_limits_and_no_goal_have_names() -> None:
    checker, start = Checker(ARM, no_people()), station("cube5")
    out = ARM.limits.q_max + 0.1
    assert plan(checker, start, np.zeros((0, 6)), PlanSettings()).outcome == "no-goal"
    goals = np.stack([start + np.array([0, 9.0, 0, 0, 0, 0])])
    assert plan(checker, start, goals, PlanSettings()).outcome == "no-goal"
    outcome = plan(checker, out, start[None], PlanSettings()).outcome
    assert outcome == "start-outside-limits"


def test_start_that_rounding_put_beyond_a_limit_is_planned_from() -> None:
    checker, start = Checker(ARM, no_people()), station("cube5")
    start[1] = ARM.limits.q_min[1] - 4e-16
    goal = station("cube0")
    found = plan(checker, start, goal[None], PlanSettings())
    assert found.outcome != "start-outside-limits"


def test_plan_that_waits_for_another_one_keeps_its_budget() -> None:
    with planners._SEEDING:
        found = ask(blocking_people(), PlanSettings(budget_s=0.1))
    assert found.outcome == "out-of-time"


def test_one_of_several_goals_is_reached() -> None:
    goals = goal_configurations(
        ARM, np.array(CELL.station("cube0").position), np.random.default_rng(0)
    )
    checker = Checker(ARM, blocking_people(), MARGIN)
    answer = plan(checker, station("cube5"), goals, PlanSettings(max_poses=20_000))
    assert answer.solved
    assert np.abs(goals - answer.path[-1])[:, :5].max(axis=1).min() < 1e-12


def test_a_cylinder_in_the_shared_workspace_is_planned_round_within_its_limits() -> None:
    cell = load_cell("shared-workspace")
    arm, rng = arm_of(cell), np.random.default_rng(0)
    goals = goal_configurations(arm, np.array([-0.4, 0.7, 0.3]), rng)
    people = shapes_of(cell, None, np.array([[0.0, 0.6, 0.2, cell.floor_z + 2.0]]))
    checker = Checker(arm, people, MARGIN)
    start = goal_configurations(arm, np.array([0.4, 0.7, 0.3]), rng)
    start = start[[checker.is_free(q) for q in start]][0]
    answer = plan(checker, start, goals, PlanSettings(max_poses=20_000))
    assert answer.solved and len(answer.path) > 2
    timed = time_free_path(checker, answer.path)
    assert timed is not None
    assert np.all(np.abs(timed.qd) <= arm.limits.qd_max + 1e-9)
    assert np.all(np.abs(np.diff(timed.qd, axis=0)) <= arm.limits.qdd_max * arm.dt + 1e-9)


def test_joints_that_stay_do_not_move() -> None:
    start = station("cube5")
    start[5] = 0.7
    checker = Checker(ARM, blocking_people(), MARGIN)
    answer = plan(checker, start, station("cube0")[None], PlanSettings(max_poses=6_000))
    assert answer.solved
    np.testing.assert_array_equal(answer.path[:, 5], 0.7)


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        (PlanSettings(planner="rrt"), "planner"),
        (PlanSettings(budget_s=-1.0), "budget_s"),
        (PlanSettings(budget_s=float("nan")), "budget_s"),
        (PlanSettings(budget_s=float("inf")), "budget_s"),
        (PlanSettings(max_poses=-1), "max_poses"),
    ],
)
def test_bad_settings_are_named(settings: PlanSettings, field: str) -> None:
    with pytest.raises(InvalidInput, match=field):
        ask(no_people(), settings)


def test_bad_numbers_are_named() -> None:
    checker, start = Checker(ARM, no_people()), station("cube5")
    with pytest.raises(InvalidInput, match="start"):
        plan(checker, start * np.nan, start[None], PlanSettings())
    with pytest.raises(InvalidInput, match="goals"):
        plan(checker, start, start, PlanSettings())
    with pytest.raises(InvalidInput, match="seed"):
        plan(checker, start, start[None], PlanSettings(), seed=0)


def test_a_machine_without_ompl_gets_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planners, "ob", None)
    with pytest.raises(MissingPackage, match="pip install ompl"):
        ask(no_people(), PlanSettings())
