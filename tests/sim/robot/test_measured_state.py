"""Measured joints a little outside their limits are answered, far outside refused by a rule."""

from dataclasses import replace

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.cells.cell import load_cell
from app.sim.collision.checker import Checker, no_people
from app.sim.robot.measured_state import StateLimits, admitting, returning
from app.sim.safety.layer import SafetyLayer, SafetySettings
from app.sim.scene.scene import arm_of

CELLS = ("shared-workspace", "pick-and-place")
ARM = arm_of(load_cell("shared-workspace"))
HOME, NONE = ARM.home, np.zeros(6)


def at(joint: int, value: float, base: np.ndarray = NONE) -> np.ndarray:
    """A vector with another number for one joint."""
    out = base.copy()
    out[joint] = value
    return out


@pytest.mark.parametrize("cell", CELLS)
def test_a_state_at_its_limits_is_taken_as_it_is(cell: str) -> None:
    arm = arm_of(load_cell(cell))
    for q, sign in ((arm.limits.q_min, -1.0), (arm.limits.q_max, 1.0)):
        qd, qdd = sign * arm.limits.qd_max, sign * arm.limits.qdd_max
        state = StateLimits(arm, limits_jerk=True).take(q, qd, qdd)
        assert state.outside == () and state.clamped is state.measured


@pytest.mark.parametrize("cell", CELLS)
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_all_joints_over_every_limit_are_clamped_and_named(cell: str, side: float) -> None:
    arm = arm_of(load_cell(cell))
    q = (arm.limits.q_max if side > 0 else arm.limits.q_min) + side * 0.04
    state = StateLimits(arm, limits_jerk=True).take(
        q, side * 1.04 * arm.limits.qd_max, side * 1.04 * arm.limits.qdd_max
    )
    assert len(state.outside) == 18 and {one.of for one in state.outside} == {"limits"}
    np.testing.assert_array_equal(state.measured.q, q)
    np.testing.assert_array_equal(
        state.clamped.q, np.clip(q, arm.limits.q_min, arm.limits.q_max)
    )
    np.testing.assert_allclose(state.clamped.qd, side * arm.limits.qd_max)
    np.testing.assert_allclose(state.clamped.qdd, side * arm.limits.qdd_max)


@pytest.mark.parametrize(
    ("q", "qd", "field", "value", "limit"),
    [
        (HOME, at(0, 1.001), "robot.qd.shoulder_pan", 1.001, 1.0),
        (HOME, at(5, 1.05), "robot.qd.wrist_3", 1.05, 1.0),
        (at(2, 2.8001, HOME), NONE, "robot.q.elbow", 2.8001, 2.8),
        (at(1, 0.25, HOME), at(1, 1.0), "robot.q.shoulder_lift", 0.25, 0.2),
    ],
)
def test_one_joint_over_one_limit_is_named_with_value_and_limit(
    q: np.ndarray, qd: np.ndarray, field: str, value: float, limit: float
) -> None:
    (one,) = StateLimits(ARM, limits_jerk=False).take(q, qd).outside
    assert (one.field, one.value, one.high) == (field, value, limit)


@pytest.mark.parametrize(
    ("q", "qd", "field", "text"),
    [
        (np.degrees(HOME), NONE, r"robot\.q\[\d\]", r"degrees\? in rad that is"),
        (at(3, 270.0, HOME), NONE, r"robot\.q\[3\]", r"degrees\? in rad that is 4.712"),
        (HOME, np.degrees(0.5 * ARM.limits.qd_max), r"robot\.qd\[0\]", r"degrees\? in rad/s"),
        (at(0, -3.9, HOME), NONE, r"robot\.q\[0\]", r"a whole turn away\? 2.383 lies inside"),
        (at(0, 5.0, HOME), NONE, r"robot\.q\[0\]", r"a whole turn away\? -1.283"),
        (at(0, 9.0, HOME), NONE, r"robot\.q\[0\]", "away|degrees"),
        (at(1, 1.0, HOME), NONE, r"robot\.q\[1\]", "at most 0.16 outside$"),
        (HOME, at(2, 1.2), r"robot\.qd\[2\]", "at most 0.05 outside$"),
        (at(4, np.nan, HOME), NONE, r"robot\.q\[4\]", "finite"),
        (HOME, at(4, -np.inf), r"robot\.qd\[4\]", "finite"),
        (HOME[:5], NONE, r"robot\.q", "6 numbers"),
    ],
)
def test_numbers_that_are_no_state_are_refused_with_a_hint(
    q: np.ndarray, qd: np.ndarray, field: str, text: str
) -> None:
    with pytest.raises(InvalidInput, match=f"{field} = .*({text})"):
        StateLimits(ARM, limits_jerk=False).take(q, qd)


def test_accelerations_are_required_where_jerk_is_limited() -> None:
    with pytest.raises(InvalidInput, match=r"robot\.qdd = None must be given"):
        StateLimits(ARM, limits_jerk=True).take(HOME, NONE)
    state = StateLimits(ARM, limits_jerk=False).take(HOME, NONE)
    assert (state.clamped.qdd == 0.0).all()


def test_joints_outside_their_limits_are_sent_inward_and_others_as_asked() -> None:
    act = np.linspace(-0.5, 0.5, 6)
    q = HOME.copy()
    q[0], q[2] = ARM.limits.q_min[0] - 0.01, ARM.limits.q_max[2] + 0.01
    inward, limits = returning(ARM, q, act)
    low, high = limits.q_min, limits.q_max
    assert (inward[0], inward[2]) == (1.0, -1.0)
    np.testing.assert_array_equal(inward[[1, 3, 4, 5]], act[[1, 3, 4, 5]])
    assert low[0] < q[0] and high[2] > q[2]
    assert (low[2], high[0]) == (ARM.limits.q_min[2], ARM.limits.q_max[0])


def test_monitoring_admits_no_more_than_the_stop_of_the_measured_state() -> None:
    assert admitting(ARM, HOME, NONE) is ARM
    q, qd = at(2, ARM.limits.q_max[2], HOME), at(2, 1.04)
    wider = admitting(ARM, q, qd)
    assert wider.limits.q_max[2] == pytest.approx(
        ARM.limits.q_max[2] + 0.5 * 1.04**2 / ARM.limits.qdd_max[2]
    )
    assert wider.limits.qd_max[2] == 1.04
    np.testing.assert_array_equal(wider.limits.qdd_max, ARM.limits.qdd_max)
    np.testing.assert_array_equal(wider.limits.q_min, ARM.limits.q_min)


def test_what_monitoring_executes_from_outside_the_limits_keeps_every_person_clear() -> None:
    rng, settings = np.random.default_rng(26), SafetySettings()
    layer, admitted = SafetyLayer(ARM, settings), 0
    for _ in range(120):
        q = HOME + rng.uniform(-0.3, 0.3, 6)
        qd = rng.choice([-1.0, 1.0], 6) * rng.uniform(0.9, 1.05, 6) * ARM.limits.qd_max
        c = -0.5 * np.sign(qd) * rng.uniform(0.5, 1.0) * ARM.limits.qdd_max
        angle, away = rng.uniform(0.0, np.pi), rng.uniform(0.9, 2.2)
        place = [away * np.cos(angle), away * np.sin(angle), 0.3, 2.0]
        people = replace(no_people(), cylinders=np.array([place]))
        safe = layer.decide(q, qd, c, NONE, people)
        assert safe.stop_time == pytest.approx(float((np.abs(qd) / ARM.limits.qdd_max).max()))
        assert safe.stop_distance == pytest.approx(
            0.5 * safe.stop_time * float(np.abs(qd) @ ARM.lever)
        )
        if safe.override == 0.0:
            continue
        admitted += 1
        checker = Checker(ARM, people)
        for t in np.linspace(0.0, ARM.dt, 5):
            reach = settings.human_speed * (settings.latency + t) + settings.margin
            assert checker.clearance(safe.at(q, qd, t)[0]).people_m > reach - 1e-9
        stop_s = float((np.abs(safe.qd) / ARM.limits.qdd_max).max())
        for t in np.linspace(0.0, stop_s, 9):
            there = safe.q + safe.qd * (t - 0.5 * t * t / max(stop_s, 1e-9))
            reach = settings.human_speed * (settings.latency + ARM.dt + t) + settings.margin
            assert checker.clearance(there).people_m > reach - 1e-9
    assert 20 < admitted < 110
