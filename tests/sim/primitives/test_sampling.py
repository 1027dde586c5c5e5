"""Samples: every one meets its via points, within the joint limits."""

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.cells.cell import load_cell
from app.sim.human import model as human
from app.sim.primitives.promp import ProMP, draw_weights, fit, moments, positions
from app.sim.primitives.sampling import GRID, beyond_limits, follow, into_limits, sample
from app.sim.primitives.via_points import (
    SLACK,
    JointVia,
    PointVia,
    Via,
    condition,
    miss,
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


@pytest.fixture(scope="module")
def wide() -> ProMP:
    """A primitive so wide that most draws leave the joint limits."""
    motions, durations = reaches()
    return fit(motions, durations, floor=0.5)


def at_rest(phase: float) -> JointVia:
    return JointVia(phase=phase, q=np.zeros(18), derivative=1)


def a_reach(cube: int) -> list[Via]:
    """From one posture at rest to a palm at a cube, at rest."""
    start = reaches()[0][0][0]
    return [
        JointVia(phase=0.0, q=start),
        at_rest(0.0),
        PointVia(phase=1.0, position=CUBES[cube]),
        at_rest(1.0),
    ]


@pytest.mark.parametrize("cube", [0, 3, 5])
def test_every_sample_meets_every_via_point_inside_the_limits(promp: ProMP, cube: int) -> None:
    vias = a_reach(cube)
    weights = sample(promp, 30, np.random.default_rng(cube), POINTS, vias)
    q = follow(promp, weights, np.array([0.0, 1.0]))
    assert np.abs(q[:, 0] - vias[0].q).max() < 1e-3
    palms = np.array([POINTS(posture)["hand_r"] for posture in q[:, 1]])
    assert np.linalg.norm(palms - CUBES[cube], axis=1).max() < 1e-3
    assert beyond_limits(promp, weights).max() <= SLACK
    assert q[:, 1].std(axis=0).max() > 0.02


def test_samples_of_linear_via_points_have_the_conditioned_moments(promp: ProMP) -> None:
    via = JointVia(phase=0.5, q=np.array([0.9, 1.2]), joints=ARM, cov=0.01 * np.eye(2))
    weights = sample(promp, 3000, np.random.default_rng(3), POINTS, [via])
    phase = np.array([0.2, 0.5, 0.8])
    mean, cov = moments(condition(promp, [via], POINTS), phase)
    q = positions(promp, weights, phase)
    spread = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
    np.testing.assert_allclose((q.mean(axis=0) - mean) / spread, 0.0, atol=0.1)
    np.testing.assert_allclose(q.std(axis=0) / spread, 1.0, atol=0.08)


def test_samples_of_a_wide_primitive_stay_inside_the_joint_limits(wide: ProMP) -> None:
    free = beyond_limits(wide, draw_weights(wide, 50, np.random.default_rng(2)))
    assert (free.reshape(50, -1).max(axis=1) > SLACK).mean() > 0.9
    weights = sample(wide, 10, np.random.default_rng(2), POINTS, a_reach(1), tries=3)
    assert beyond_limits(wide, weights).max() <= SLACK
    q = follow(wide, weights, np.linspace(0.0, 1.0, 1001))
    assert (q >= human.Q_MIN).all() and (q <= human.Q_MAX).all()
    assert np.abs(q - positions(wide, weights, np.linspace(0.0, 1.0, 1001))).max() < 2e-3


def test_projection_leaves_what_is_inside_as_it_is(promp: ProMP) -> None:
    weights = into_limits(promp, promp.mean, [], POINTS)
    np.testing.assert_array_equal(weights, promp.mean)
    assert beyond_limits(promp, weights).shape == (len(GRID), 18)


def test_projection_bends_a_posture_at_its_limits_to_meet_the_palm(wide: ProMP) -> None:
    start = wide.mean.copy()
    start[human.JOINT_NAMES.index("elbow_r")] = -0.3
    start[human.JOINT_NAMES.index("abdomen_twist")] = 1.4
    via = PointVia(phase=1.0, position=CUBES[1])
    weights = into_limits(wide, start, [via], POINTS)
    assert beyond_limits(wide, start).max() > 0.29
    assert beyond_limits(wide, weights).max() <= SLACK
    assert miss(wide, weights, via, POINTS) < 1e-3


def test_posture_just_at_its_limits_may_be_a_via_point(promp: ProMP) -> None:
    straight = JointVia(phase=1.0, q=np.zeros(1), joints=("elbow_r",))
    weights = sample(promp, 10, np.random.default_rng(4), POINTS, [straight])
    assert beyond_limits(promp, weights).max() <= SLACK
    elbow = follow(promp, weights, np.array([1.0]))[:, 0, human.JOINT_NAMES.index("elbow_r")]
    assert (elbow >= 0.0).all() and elbow.max() < 1e-3


def test_same_seed_draws_the_same_samples_and_another_does_not(promp: ProMP) -> None:
    vias = a_reach(2)
    one, same, other = (
        sample(promp, 2, np.random.default_rng(seed), POINTS, vias) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one, same)
    assert np.abs(one - other).max() > 0.01


def test_palm_that_no_arm_can_reach_has_no_sample(promp: ProMP) -> None:
    vias = [
        JointVia(phase=1.0, q=reaches()[0][0][0][:6], joints=human.JOINT_NAMES[:6]),
        PointVia(phase=1.0, position=np.array([0.0, 0.0, 4.0])),
    ]
    with pytest.raises(InvalidInput, match="cannot be met"):
        sample(promp, 1, np.random.default_rng(0), POINTS, vias, tries=1)
