"""Phases of a pick: when the tool descends, when the gripper closes, when a pick ends."""

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.pick.batch import PickBatch, PickSettings
from app.sim.pick.kernels.grasp import (
    APPROACH,
    DESCEND,
    LIFT,
    GraspRules,
    ToolState,
    distance_left,
    next_phase,
)
from app.sim.pick.kernels.observation_layout import LAYOUT

RULES = GraspRules()
GOAL = np.array([0.3, 0.7, 0.12])
DT = 0.05


def after(
    phase: int,
    over: float,
    closing: float = 0.0,
    *,
    aside: float = 0.0,
    tilt: float = 0.0,
    speed: float = 0.0,
    clearance: float = 1.0,
) -> tuple[int, float, bool]:
    """The phase after a period that ends ``over`` the target [m]."""
    tcp = GOAL + [aside, 0.0, over]
    tool = ToolState(tcp, tilt, speed, clearance)
    return next_phase(RULES, phase, closing, GOAL, tool, DT)


def test_descent_starts_at_the_target_upright_slow_and_away_from_people() -> None:
    assert after(APPROACH, 0.02)[0] == DESCEND
    assert after(APPROACH, 0.04)[0] == APPROACH
    assert after(APPROACH, 0.0, aside=0.04)[0] == APPROACH
    assert after(APPROACH, 0.0, tilt=0.11)[0] == APPROACH
    assert after(APPROACH, 0.0, speed=0.11)[0] == APPROACH
    assert after(APPROACH, 0.0, clearance=0.055)[0] == APPROACH


def test_gripper_closes_while_the_tool_is_held_at_the_object() -> None:
    assert after(DESCEND, -RULES.depth) == (DESCEND, DT, False)
    assert after(DESCEND, -RULES.depth + 0.03, 0.4) == (DESCEND, 0.4, False)
    assert after(DESCEND, -RULES.depth, 0.4, speed=0.2) == (DESCEND, 0.4, False)
    phase, closing, ended = after(DESCEND, -RULES.depth, RULES.close_s - DT)
    assert (phase, ended) == (LIFT, False)
    assert closing == pytest.approx(RULES.close_s)


def test_descent_is_broken_off_by_a_person_or_beside_the_object() -> None:
    assert after(DESCEND, -RULES.depth, 0.9, clearance=0.049) == (APPROACH, 0.0, False)
    assert after(DESCEND, -0.03, 0.9, aside=0.07) == (APPROACH, 0.0, False)


def test_an_object_that_is_up_again_ends_the_pick() -> None:
    assert after(LIFT, -0.02, 1.25) == (LIFT, 1.25, False)
    assert after(LIFT, -0.01, 1.25) == (LIFT, 1.25, True)
    assert after(LIFT, -0.03, 1.25, clearance=0.01) == (LIFT, 1.25, False)


def test_distance_left_is_continuous_where_the_phase_changes_as_planned() -> None:
    low = GOAL - [0.0, 0.0, RULES.depth]
    assert distance_left(RULES, APPROACH, GOAL, GOAL) == pytest.approx(2 * RULES.depth)
    assert distance_left(RULES, DESCEND, GOAL, GOAL) == pytest.approx(2 * RULES.depth)
    assert distance_left(RULES, DESCEND, GOAL, low) == pytest.approx(RULES.depth)
    assert distance_left(RULES, LIFT, GOAL, low) == pytest.approx(RULES.depth)
    assert distance_left(RULES, LIFT, GOAL, GOAL) == 0.0


def test_base_motion_picks_every_object_in_an_empty_cell() -> None:
    """And the grasp takes the 2 s that the cell states."""
    settings = PickSettings(
        time_limit_s=12.0, people=(), grasp=RULES, anywhere_share=0.3, observation="phase"
    )
    batch = PickBatch(load_cell(), 200, 5, settings)
    batch.reset()
    grasping = np.zeros(200)
    while (batch.state.outcome == 0).any():
        grasping += DT * ((batch.state.phase != APPROACH) & (batch.state.outcome == 0))
        batch.step(0.9 * batch.obs[:, LAYOUT["base"]], auto_reset=False)
    assert (batch.state.outcome == 1).all()
    assert 1.8 < grasping.min() < grasping.max() < 2.4


def test_gripper_closes_only_at_a_slow_tool_however_deep_the_object_is() -> None:
    settings = PickSettings(people=(), grasp=RULES._replace(depth=0.2), observation="phase")
    batch = PickBatch(load_cell(), 2, 5, settings)
    batch.reset()
    batch.set_goals(np.arange(2), batch.world.stations[:2] + [0.0, 0.0, 0.25])
    batch.set_starts(batch.state.q_grasp)
    batch.state.phase[:] = DESCEND
    batch.state.qd[0, 1] = 0.25
    act = (batch.state.qd[:, :5] / batch.arm.limits.qd_max[:5]).astype(np.float32)
    batch.step(act, auto_reset=False)
    assert batch.state.phase.tolist() == [DESCEND, DESCEND]
    assert batch.state.closing.tolist() == [0.0, DT]


def test_the_same_target_continues_a_pick_and_another_one_restarts_it() -> None:
    settings = PickSettings(people=(), grasp=RULES, observation="phase")
    batch = PickBatch(load_cell(), 2, 5, settings)
    batch.reset()
    batch.state.phase[:], batch.state.closing[:] = DESCEND, 0.5
    goals = batch.state.goal.copy()
    goals[1] = batch.world.stations[3]
    batch.set_goals(np.arange(2), goals)
    assert batch.state.phase.tolist() == [DESCEND, APPROACH]
    assert batch.state.closing.tolist() == [0.5, 0.0]
