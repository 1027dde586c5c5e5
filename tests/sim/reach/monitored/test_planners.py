"""Planners drive guarded cells: they arrive alone, wait for people, and replay exactly."""

from dataclasses import replace

import numpy as np

from app.sim.cells.cell import load_cell
from app.sim.planning.goal_configurations import goal_configurations_of
from app.sim.planning.ompl_planners import PlanSettings
from app.sim.planning.replanning import ReplanningSettings
from app.sim.reach.batch import ReachSettings
from app.sim.reach.monitored.batch import MonitoredReachBatch
from app.sim.reach.monitored.planners import GOAL_SPREAD, drive_planner
from app.sim.robot.ur10 import Robot
from app.sim.safety.layer import safety_settings
from app.sim.scenario.monitoring import MonitoringSettings
from app.sim.scene.scene import arm_of

CELL = load_cell("shared-workspace")
ARM = arm_of(CELL)
GOALS = np.array([[0.2, 0.9, 0.3], [-0.2, 0.85, 0.25]])
Q_GOALS = goal_configurations_of(ARM, GOALS, 3, GOAL_SPREAD)
PLANNED = PlanSettings(planner="rrt-connect", max_poses=6_000)
RULES = ReachSettings(goals="box", people=("walker",), time_limit_s=15.0)


def obstructing(leaves_s: float) -> np.ndarray:
    """Somebody between robot and goals who walks off to the side after a while."""
    t = 0.02 * np.arange(600)
    x = 0.05 + np.maximum(0.0, t - leaves_s)
    return np.repeat(
        np.column_stack([x, np.full(600, 0.7), np.full(600, 0.2)])[None], 2, axis=0
    )


def run(role: str, tracks: np.ndarray | None, **more: bool) -> MonitoredReachBatch:
    rules = RULES if tracks is not None else replace(RULES, people=())
    batch = MonitoredReachBatch(
        CELL,
        2,
        0,
        rules,
        safety_settings(CELL),
        MonitoringSettings(rest_ends=False),
        tracks=tracks,
    )
    batch.reset()
    batch.set_goals(np.arange(2), GOALS)
    overrides = drive_planner(
        batch, Q_GOALS, ReplanningSettings(role=role, plan=PLANNED), 5, **more
    )
    for row, course in enumerate(overrides):
        assert len(course) == round(batch.runs().seconds[row] / ARM.dt)
    return batch


def test_goal_configurations_lie_where_success_counts():
    robot = Robot(CELL.robot.tool_length)
    for goal, configurations in zip(GOALS, Q_GOALS, strict=True):
        assert len(configurations) >= 2
        for q in configurations:
            assert np.linalg.norm(robot.tcp_pose(q)[:3, 3] - goal) <= GOAL_SPREAD + 1e-3


def test_alone_every_role_arrives_at_once():
    times = {
        role: run(role, None).runs()
        for role in ("plan-once", "replan-on-blocked", "replan-every-cycle")
    }
    for runs in times.values():
        assert runs.arrived.all()
        assert (runs.stopped_s == 0.0).all()
        np.testing.assert_allclose(runs.seconds, times["plan-once"].seconds, atol=0.05)


def test_a_planner_waits_until_who_holds_it_has_gone():
    runs = run("replan-on-blocked", obstructing(2.0)).runs()
    assert runs.arrived.all()
    assert (runs.stopped_s > 2.0).all()
    assert (runs.seconds > 3.0).all()


def test_blind_planner_gets_no_people():
    given = run("plan-once", obstructing(2.0), blind=True).runs()
    alone = run("plan-once", None).runs()
    np.testing.assert_allclose(given.joint_path, alone.joint_path, atol=0.1)
    assert (given.seconds > alone.seconds + 1.0).all()
