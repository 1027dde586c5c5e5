"""A yielding person slows and leans away from the tool; one without does not see it."""

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.human import model as human
from app.sim.people.human_motion_config import HumanMotionConfig
from app.sim.people.kernels.yielding import D_SLOW, D_STOP, LEAN, closeness, lean_away
from app.sim.pick.batch import PickBatch, PickSettings
from app.sim.pick.kernels.observation_layout import LAYOUT
from app.sim.scenario.kernels.episode import RUNNING

DT = 0.05
LIMITS = np.stack([human.Q_MIN, human.Q_MAX])


def robot_at(x: float, y: float) -> np.ndarray:
    columns = np.zeros((9, 2))
    columns[0], columns[1] = x, y
    return columns


def leaned(yaw: float, tool: tuple[float, float], seconds: float = 3.0) -> np.ndarray:
    """Abdomen flexion and side bend after a while beside a close tool [rad]."""
    lean, q, qd = np.zeros(4), np.empty(18), np.empty(18)
    for _ in range(int(seconds / DT)):
        q[:], qd[:] = human.rest_posture(0.0, 0.0, yaw), 0.0
        lean_away(q, qd, lean, 1.0, robot_at(*tool), LIMITS, DT)
    return q[3:5]


def test_closeness_goes_from_nothing_to_all() -> None:
    assert closeness(D_SLOW) == closeness(5.0) == 0.0
    assert closeness(D_STOP) == closeness(-0.1) == 1.0
    assert closeness(0.5 * (D_SLOW + D_STOP)) == pytest.approx(0.5)


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5])
def test_the_head_moves_away_from_the_tool_wherever_it_comes_from(yaw: float) -> None:
    size = load_cell().body
    for angle in np.linspace(0.0, 2.0 * np.pi, 9):
        tool = (0.6 * np.cos(angle), 0.6 * np.sin(angle))
        q = human.rest_posture(0.0, 0.0, yaw)
        before = human.joint_points(q, size)["head"][:2]
        q[3:5] += leaned(yaw, tool)
        moved = human.joint_points(q, size)["head"][:2] - before
        assert moved @ np.array(tool) < -0.02


def test_a_lean_grows_smoothly_up_to_its_bound() -> None:
    flex = [leaned(0.0, (0.5, 0.0), seconds)[0] for seconds in (0.05, 0.2, 0.5, 4.0)]
    assert 0.0 > flex[0] > flex[1] > flex[2] > flex[3] > -LEAN - 1e-9
    assert flex[3] == pytest.approx(-LEAN, abs=1e-3)


def after(yielding: float, robot_moves: bool, steps: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Joints of the workers after a while, and which episodes have not ended by then."""
    work = HumanMotionConfig(motion="reaches", yielding=yielding)
    batch = PickBatch(load_cell(), 64, 3, PickSettings(work=work))
    act, still = batch.reset()[:, LAYOUT["base"]], np.zeros((64, 5), dtype=np.float32)
    for _ in range(steps):
        obs = batch.step(act if robot_moves else still, auto_reset=False).obs
        act = np.clip(obs[:, LAYOUT["base"]], -1.0, 1.0)
    return batch.state.people.q[:, 0].copy(), batch.state.outcome == RUNNING


def test_without_yielding_the_person_does_not_see_what_the_robot_does() -> None:
    (blind, there), (alone, here) = after(0.0, robot_moves=True), after(0.0, robot_moves=False)
    both = there & here
    assert both.sum() > 10
    np.testing.assert_array_equal(blind[both], alone[both])


def test_with_yielding_the_person_leaves_its_script_beside_the_arm() -> None:
    (blind, there), (kind, here) = after(0.0, robot_moves=True), after(1.0, robot_moves=True)
    both = there & here
    apart = np.abs(kind[both] - blind[both]).max(axis=1)
    assert (apart > 0.02).sum() > 5
    assert (kind >= human.Q_MIN).all() and (kind <= human.Q_MAX).all()
