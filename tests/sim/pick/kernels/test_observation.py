"""What the networks see: the layout, and values checked against the models."""

from typing import Any

import numpy as np
import pytest

from app.sim.cells.cell import Cell, load_cell
from app.sim.collision.contact import clearance
from app.sim.core.observation_layout import slices_of
from app.sim.human import model as human
from app.sim.pick.batch import PickBatch, PickSettings
from app.sim.pick.candidate_observer import CandidateObserver
from app.sim.pick.kernels.base_motion import base_motion
from app.sim.pick.kernels.grasp import DESCEND, GraspRules
from app.sim.pick.kernels.observation_layout import (
    DISTANCE_SCALE,
    LAYOUT,
    N_FEATURES,
    N_PICK,
    N_WITH_PHASE,
    PICK_SIZES,
)
from app.sim.pick.task_policy import PickProgress
from app.sim.prediction.kernels.worker import TIMES, predict_worker
from app.sim.prediction.weights import new_worker_predictor
from app.sim.robot.ur10 import Robot
from app.sim.scenario.kernels.person_observation import BASE_GAIN, HORIZONS
from app.sim.scene.scene import NO_CYLINDERS, arm_of, people_of


@pytest.fixture(scope="module")
def cell() -> Cell:
    return load_cell()


def state(cell: Cell) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(95)
    person = human.rest_posture(0.1, 1.3, -1.4)
    return {
        "q": np.array(cell.robot.home_q) + rng.normal(0, 0.2, 6) * [1, 1, 1, 1, 1, 0],
        "qd": rng.uniform(-0.5, 0.5, 6) * [1, 1, 1, 1, 1, 0],
        "human_q": person + rng.normal(0, 0.1, 18),
        "human_qd": rng.normal(0, 0.5, 18),
        "goals": np.array([station.position for station in cell.stations]),
    }


def seen(cell: Cell, **changes: Any) -> np.ndarray:
    at = state(cell) | changes
    human_q, human_qd = np.atleast_2d(at["human_q"]), np.atleast_2d(at["human_qd"])
    people = human_q, human_qd, np.tile(cell.body, (len(human_q), 1))
    observer = CandidateObserver(cell, **at.get("task", {}))
    robot, current = (at["q"], at["qd"]), at.get("current", ())
    return observer.observe(robot, people, at["goals"], 7.0, *current)[0]


def test_layout_covers_the_observation_without_gap_or_overlap() -> None:
    covered = np.concatenate([np.arange(N_FEATURES)[part] for part in LAYOUT.values()])
    np.testing.assert_array_equal(covered, np.arange(N_FEATURES))


def test_tool_and_target_are_where_pinocchio_has_them(cell: Cell) -> None:
    obs, at, robot = seen(cell), state(cell), Robot()
    pose = robot.tcp_pose(at["q"])
    velocity = (robot.jacobian(at["q"]) @ at["qd"])[:3]
    for row, goal in zip(obs, at["goals"], strict=True):
        np.testing.assert_allclose(row[LAYOUT["tcp"]], pose[:3, 3], atol=1e-5)
        away = 2.0 * (goal - pose[:3, 3])
        np.testing.assert_allclose(row[LAYOUT["goal_minus_tcp"]], away, atol=1e-5)
        np.testing.assert_allclose(row[LAYOUT["tcp_velocity"]], 2 * velocity, atol=1e-5)
        np.testing.assert_allclose(row[LAYOUT["tool_axis"]], pose[:3, 2], atol=1e-5)


def test_hand_velocities_are_the_derivatives_of_the_hands(cell: Cell) -> None:
    at, step = state(cell), 1e-6
    before = human.joint_points(at["human_q"], cell.body)
    after = human.joint_points(at["human_q"] + step * at["human_qd"], cell.body)
    speeds = [(after[hand] - before[hand]) / step for hand in ("hand_r", "hand_l")]
    row = seen(cell)[0, LAYOUT["hand_velocities"]]
    np.testing.assert_allclose(row, np.concatenate(speeds), atol=0.01)


def test_a_full_turn_of_the_person_changes_nothing(cell: Cell) -> None:
    turned = state(cell)["human_q"] + 2 * np.pi * (np.arange(18) == 2)
    np.testing.assert_allclose(seen(cell, human_q=turned), seen(cell), atol=1e-5)


def test_candidates_do_not_influence_one_another(cell: Cell) -> None:
    together, goals = seen(cell), state(cell)["goals"]
    for i, goal in enumerate(goals):
        np.testing.assert_array_equal(seen(cell, goals=goal[None])[0], together[i])


def test_base_motion_leads_to_the_posture_at_the_target(cell: Cell) -> None:
    at = state(cell)
    limits = np.array(cell.robot.q_min), np.array(cell.robot.q_max)
    for row, goal in zip(seen(cell), at["goals"], strict=True):
        offset = Robot().ik_vertical(goal, *limits)[:5] - at["q"][:5]
        np.testing.assert_allclose(row[LAYOUT["goal_posture_minus_q"]], offset, atol=1e-5)
        base = row[LAYOUT["base"]]
        np.testing.assert_allclose(
            base / np.abs(base).max(), offset / np.abs(offset).max(), atol=1e-5
        )


def test_joints_with_other_speed_limits_arrive_together_by_base_motion(cell: Cell) -> None:
    """And one joint is at its limit until the differences are small."""
    limits = np.array([0.5, 1.0, 0.25, 2.0, 3.2, 3.2])
    robot = cell.robot.model_copy(update={"qd_max": tuple(limits)})
    arm = arm_of(cell.model_copy(update={"robot": robot}))
    goal, q, out = np.array([1.0, -0.8, 0.6, 0.5, -0.4, 0.0]), np.zeros(6), np.zeros(5)
    for _ in range(120):
        base_motion(arm, q, goal, out)
        left = np.abs(goal - q)[:5] / limits[:5]
        assert np.abs(out).max() == pytest.approx(min(1.0, BASE_GAIN * left.max()))
        q[:5] += out * limits[:5] * arm.dt
        np.testing.assert_allclose(q[:5] / goal[:5], q[0] / goal[0], atol=1e-12)
    np.testing.assert_allclose(q, goal, atol=1e-4)


def test_person_far_away_is_seen_at_the_farthest_distance(cell: Cell) -> None:
    away = human.rest_posture(0.0, 4.9, -1.57)
    row = seen(cell, human_q=away, human_qd=np.zeros(18))[0]
    assert row[LAYOUT["distance_tilt_clearance_time"]][2] == 3.0
    np.testing.assert_array_equal(row[LAYOUT["look_ahead_still"]], 3.0)


def test_approaching_person_shortens_the_look_ahead(cell: Cell) -> None:
    person, walking = human.rest_posture(0.0, 1.6, -1.57), np.zeros(18)
    walking[1] = -0.5
    row = seen(cell, human_q=person, human_qd=walking)[0]
    ahead = row[LAYOUT["look_ahead_still"]] * DISTANCE_SCALE
    assert (np.diff(ahead) < 0).all()


def test_seen_values_stay_within_a_few_units(cell: Cell) -> None:
    batch = PickBatch(cell, 200, 3, PickSettings())
    obs = batch.reset().copy()
    for _ in range(20):
        obs = batch.step(np.ones((200, 5), dtype=np.float32)).obs
        assert np.isfinite(obs).all()
        assert np.abs(obs).max() < 15.0


@pytest.mark.parametrize(("length", "radius"), [(0.12, 0.04), (0.3, 0.04), (0.4, 0.12)])
def test_clearance_of_a_longer_or_wider_tool_is_not_above_that_of_its_capsule(
    cell: Cell, length: float, radius: float
) -> None:
    tool = {"tool_length": length, "tool_radius": radius}
    robot = cell.robot.model_copy(update=tool)
    other, at = cell.model_copy(update={"robot": robot}), state(cell)
    tcp = Robot(length).tcp_pose(at["q"])[:3, 3]
    person = human.rest_posture(tcp[0], tcp[1] + 0.45, -np.pi / 2)
    row = seen(other, human_q=person)[0]
    shown = DISTANCE_SCALE * row[LAYOUT["distance_tilt_clearance_time"]][2]
    exact = clearance(arm_of(other), people_of(other), at["q"], person[None], NO_CYLINDERS)
    assert 0.0 < exact.people_m < 0.5
    assert -0.05 < shown - exact.people_m < 0.01


PICK = slices_of(PICK_SIZES)


PICKING = {"n_obs": N_PICK, "grasp": GraspRules()}


def test_a_pick_adds_to_the_features_of_a_reach(cell: Cell) -> None:
    reach, both = seen(cell), seen(cell, task=PICKING)
    ahead = ("look_ahead_still", "look_ahead_base", "goal_clearance")
    places = np.concatenate([np.arange(N_FEATURES)[LAYOUT[name]] for name in ahead])
    other = np.setdiff1d(np.arange(N_FEATURES), places)
    np.testing.assert_array_equal(both[:, other], reach[:, other])
    np.testing.assert_array_equal(both[:, PICK["phase"]], [[1, 0, 0]] * len(reach))


def test_clearances_ahead_are_those_to_the_predicted_person(cell: Cell) -> None:
    at = state(cell)
    at["human_q"] = human.rest_posture(0.1, 1.2, -1.5)
    predicted = np.empty((len(HORIZONS), 18))
    predict_worker(new_worker_predictor(), at["human_q"], at["human_qd"], predicted)
    row = seen(cell, **at, task=PICKING)[0]
    for k, posture in enumerate(predicted):
        there = seen(cell, **at | {"human_q": posture}, task=PICKING)[0]
        now = there[LAYOUT["distance_tilt_clearance_time"]][2]
        assert row[LAYOUT["look_ahead_still"]][k] == pytest.approx(now, abs=1e-5)
        at_goal = there[LAYOUT["goal_clearance"]][0]
        assert row[LAYOUT["goal_clearance"]][1 + k] == pytest.approx(at_goal, abs=1e-5)
    assert TIMES == HORIZONS


def test_in_the_descent_the_target_is_the_object(cell: Cell) -> None:
    over = seen(cell, task=PICKING)
    low = seen(cell, task=PICKING, current=(1, PickProgress(phase=DESCEND, closing_s=0.5)))
    np.testing.assert_array_equal(np.delete(low, 1, axis=0), np.delete(over, 1, axis=0))
    goal = over[1, LAYOUT["goal_minus_tcp"]] - [0, 0, 2.0 * GraspRules().depth]
    np.testing.assert_allclose(low[1, LAYOUT["goal_minus_tcp"]], goal, atol=1e-6)
    np.testing.assert_array_equal(low[1, PICK["phase"]], [0, 1, 0])
    assert low[1, PICK["closing"]] == pytest.approx(0.5 / GraspRules().close_s)


def test_the_second_person_is_the_one_nearer_to_the_target(cell: Cell) -> None:
    first = human.rest_posture(0.0, 1.2, -1.57)
    left, right = (human.rest_posture(x, 1.3, -1.57) for x in (-0.6, 0.6))
    goals = np.array([[-0.5, 0.7, 0.12], [0.5, 0.7, 0.12]])
    obs = seen(
        cell,
        human_q=np.stack([first, left, right]),
        human_qd=np.zeros((3, 18)),
        goals=goals,
        task=PICKING,
    )
    np.testing.assert_allclose(obs[:, PICK["second_pelvis"]][:, 0], [-0.6, 0.6], atol=1e-6)
    alone = seen(cell, human_q=left, human_qd=np.zeros(18), goals=goals, task=PICKING)
    np.testing.assert_allclose(
        obs[0, PICK["second_goal_clearance"]], alone[0, LAYOUT["goal_clearance"]], atol=1e-6
    )
    for name in ("second_look_ahead_still", "second_look_ahead_base"):
        one = name.removeprefix("second_")
        np.testing.assert_allclose(obs[0, PICK[name]], alone[0, LAYOUT[one]], atol=1e-6)


def test_without_a_second_person_within_4_m_one_far_away_is_observed(cell: Cell) -> None:
    row, at = seen(cell, task=PICKING)[0], state(cell)
    np.testing.assert_array_equal(row[PICK["second_clearance"].start :], 3.0)
    np.testing.assert_allclose(row[PICK["second_pelvis"]], [0.0, 2.75, 0.0], atol=1e-6)
    for x, y in ((3.0, 2.9), (0.0, 4.0)):
        two = np.stack([at["human_q"], human.rest_posture(x, y, 0.5)])
        moving = np.stack([at["human_qd"], np.ones(18)])
        beside = seen(cell, human_q=two, human_qd=moving, task=PICKING)[0]
        np.testing.assert_array_equal(beside, row)
    two[1, 1] = 3.9
    beside = seen(cell, human_q=two, human_qd=moving, task=PICKING)[0]
    np.testing.assert_allclose(beside[PICK["second_pelvis"]][1], 2.65, atol=1e-6)
    one = seen(cell, task=PICKING | {"n_obs": N_WITH_PHASE})[0]
    np.testing.assert_array_equal(row[:N_WITH_PHASE], one)
