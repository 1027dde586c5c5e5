"""Via points: met by the mean, in joints and in space, as exactly as asked."""

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.cells.cell import load_cell
from app.sim.human import model as human
from app.sim.primitives.promp import ProMP, fit, moments, positions
from app.sim.primitives.via_points import (
    JointVia,
    PointVia,
    Via,
    condition,
    miss,
    point_jacobian,
    points_of,
)
from tests.sim.demonstrations import reaches

CELL = load_cell()
POINTS = points_of(CELL.body)
CUBES = np.array([station.position for station in CELL.stations_of("cube")])
ARM = ("shoulder_r_flex", "elbow_r")


@pytest.fixture(scope="module")
def promp() -> ProMP:
    return fit(*reaches())


def at_rest(phase: float) -> JointVia:
    return JointVia(phase=phase, q=np.zeros(18), derivative=1)


def test_mean_meets_a_whole_posture(promp: ProMP) -> None:
    q = moments(promp, np.array([0.4]))[0][0] + np.random.default_rng(1).normal(0.0, 0.1, 18)
    found = moments(condition(promp, [JointVia(phase=0.4, q=q)], POINTS), np.array([0.4]))
    np.testing.assert_allclose(found[0][0], q, atol=1e-5)
    np.testing.assert_allclose(found[1][0], 0.0, atol=1e-9)


def test_some_joints_are_met_and_the_others_stay_free(promp: ProMP) -> None:
    via = JointVia(phase=0.7, q=np.array([0.9, 1.2]), joints=ARM)
    mean, cov = moments(condition(promp, [via], POINTS), np.array([0.7]))
    held = [human.JOINT_NAMES.index(name) for name in ARM]
    np.testing.assert_allclose(mean[0, held], via.q, atol=1e-5)
    spread = np.sqrt(np.diag(cov[0]))
    assert spread[held].max() < 1e-4 < 5e-3 < np.delete(spread, held).min()


def test_uncertain_via_point_pulls_by_its_share_of_the_certainty(promp: ProMP) -> None:
    joint = human.JOINT_NAMES.index("elbow_r")
    mean, cov = moments(promp, np.array([0.5]))
    own, before = cov[0, joint, joint], mean[0, joint]
    via = JointVia(
        phase=0.5, q=np.array([before + 0.2]), joints=("elbow_r",), cov=np.array([[own]])
    )
    after, spread = moments(condition(promp, [via], POINTS), np.array([0.5]))
    assert after[0, joint] == pytest.approx(before + 0.1, abs=1e-6)
    assert spread[0, joint, joint] == pytest.approx(0.5 * own, rel=1e-4)


def test_speed_via_point_stops_the_joints(promp: ProMP) -> None:
    stopped = condition(promp, [at_rest(0.5)], POINTS)
    around = positions(stopped, stopped.mean, np.array([0.5 - 1e-4, 0.5 + 1e-4]))
    np.testing.assert_allclose(np.diff(around, axis=0) / 2e-4, 0.0, atol=1e-4)


@pytest.mark.parametrize("point", ["hand_r", "hand_l", "elbow_r", "neck"])
def test_jacobian_predicts_small_motions_of_a_point(promp: ProMP, point: str) -> None:
    rng = np.random.default_rng(7)
    q = moments(promp, np.array([0.6]))[0][0]
    change = rng.normal(0.0, 1e-4, 18)
    moved = POINTS(q + change)[point] - POINTS(q)[point]
    np.testing.assert_allclose(point_jacobian(q, point, POINTS) @ change, moved, atol=1e-6)


@pytest.mark.parametrize("cube", range(6))
def test_mean_brings_the_palm_to_every_cube_within_a_millimetre(
    promp: ProMP, cube: int
) -> None:
    via = PointVia(phase=1.0, position=CUBES[cube])
    found = condition(promp, [via], POINTS)
    q = moments(found, np.array([1.0]))[0][0]
    assert np.linalg.norm(POINTS(q)["hand_r"] - CUBES[cube]) < 1e-3
    assert np.linalg.eigvalsh(found.cov).min() > -1e-10


def test_uncertain_palm_is_as_uncertain_as_asked(promp: ProMP) -> None:
    wanted = POINTS(moments(promp, np.array([1.0]))[0][0])["hand_r"] + [0.05, 0.0, 0.03]
    via = PointVia(phase=1.0, position=wanted, cov=1e-6 * np.eye(3))
    mean, cov = moments(condition(promp, [via], POINTS), np.array([1.0]))
    jacobian = point_jacobian(mean[0], "hand_r", POINTS)
    spread = np.sqrt(np.diag(jacobian @ cov[0] @ jacobian.T))
    assert np.linalg.norm(POINTS(mean[0])["hand_r"] - wanted) < 1e-3
    assert (spread > 5e-4).all() and (spread < 1.001e-3).all()


def test_two_hands_and_a_posture_are_met_together(promp: ProMP) -> None:
    left = POINTS(moments(promp, np.array([1.0]))[0][0])["hand_l"] + [0.02, 0.03, 0.02]
    vias = [
        JointVia(phase=0.0, q=reaches()[0][3][0]),
        PointVia(phase=1.0, position=CUBES[2]),
        PointVia(phase=1.0, position=left, point="hand_l"),
    ]
    found = condition(promp, vias, POINTS)
    assert max(miss(found, found.mean, via, POINTS) for via in vias) < 1e-3


def test_elbow_moves_aside_while_the_palm_keeps_its_via_points(promp: ProMP) -> None:
    phases = (0.0, 0.25, 0.5, 0.75, 1.0)
    q = moments(promp, np.array(phases))[0]
    palms = [
        PointVia(phase=z, position=POINTS(q_z)["hand_r"])
        for z, q_z in zip(phases, q, strict=True)
    ]
    elbow = POINTS(q[2])["elbow_r"]
    vias = [
        *palms,
        PointVia(
            phase=0.5,
            position=elbow + [0, 0, 0.06],
            point="elbow_r",
            cov=np.diag([1.0, 1.0, 1e-6]),
        ),
    ]
    found = condition(promp, vias, POINTS)
    raised = POINTS(moments(found, np.array([0.5]))[0][0])["elbow_r"]
    assert max(miss(found, found.mean, via, POINTS) for via in palms) < 1e-3
    assert raised[2] - elbow[2] > 0.05


@pytest.mark.parametrize(
    ("via", "field"),
    [
        (JointVia(phase=1.2, q=np.zeros(18)), "vias[0].phase"),
        (JointVia(phase=np.nan, q=np.zeros(18)), "vias[0].phase"),
        (JointVia(phase=0.5, q=np.zeros(17)), "vias[0]"),
        (JointVia(phase=0.5, q=np.array([np.nan]), joints=("elbow_r",)), "vias[0]"),
        (JointVia(phase=0.5, q=np.zeros(1), joints=("knee_r",)), "vias[0].joints"),
        (JointVia(phase=0.5, q=np.array([2.7]), joints=("elbow_r",)), "vias[0].q.elbow_r"),
        (PointVia(phase=0.5, position=np.zeros(2)), "vias[0]"),
        (PointVia(phase=0.5, position=np.zeros(3), point="knee_r"), "vias[0].point"),
        (PointVia(phase=0.5, position=np.zeros(3), cov=np.eye(2)), "vias[0].cov"),
        (PointVia(phase=0.5, position=np.zeros(3), cov=-np.eye(3)), "vias[0].cov"),
    ],
)
def test_broken_via_point_is_named(promp: ProMP, via: Via, field: str) -> None:
    with pytest.raises(InvalidInput) as caught:
        condition(promp, [via], POINTS)
    assert caught.value.field == field


def test_via_points_that_contradict_one_another_are_refused(promp: ProMP) -> None:
    vias = [JointVia(phase=0.5, q=np.array([q]), joints=("elbow_r",)) for q in (0.5, 1.5)]
    with pytest.raises(InvalidInput, match="cannot be met"):
        condition(promp, vias, POINTS)


def test_palm_that_no_arm_can_reach_is_refused(promp: ProMP) -> None:
    vias = [
        JointVia(phase=1.0, q=reaches()[0][0][0][:6], joints=human.JOINT_NAMES[:6]),
        PointVia(phase=1.0, position=np.array([0.0, 0.0, 4.0])),
    ]
    with pytest.raises(InvalidInput, match="cannot be met"):
        condition(promp, vias, POINTS)
