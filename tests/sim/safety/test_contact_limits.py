"""Contact speeds of power and force limiting, against numbers worked out by hand."""

import numpy as np
import pytest

from app.sim.human.kernels import kinematics as body
from app.sim.robot.ur10 import Robot
from app.sim.safety import contact_limits
from app.sim.safety.contact_limits import (
    REGIONS,
    capsule_contact_speeds,
    contact_speed,
    cylinder_contact_speed,
)
from app.sim.safety.layer import SafetySettings, contact_speeds

BY_HAND = {
    # F [N], k [N/mm], mu = m_H m_R / (m_H + m_R) with m_R = 14.35 kg, v = F / sqrt(mu k)
    "skull and forehead": 110.0 / (3.3675 * 150_000.0) ** 0.5,
    "face": 65.0 / (3.3675 * 75_000.0) ** 0.5,
    "neck": 2 * 140.0 / (1.1074 * 50_000.0) ** 0.5,
    "back and shoulders": 2 * 160.0 / (10.5612 * 35_000.0) ** 0.5,
    "chest": 2 * 120.0 / (10.5612 * 25_000.0) ** 0.5,
    "abdomen": 2 * 110.0 / (10.5612 * 10_000.0) ** 0.5,
    "pelvis": 2 * 180.0 / (10.5612 * 25_000.0) ** 0.5,
    "upper arms and elbow joints": 2 * 150.0 / (2.4813 * 30_000.0) ** 0.5,
    "lower arms and wrist joints": 2 * 160.0 / (1.7554 * 40_000.0) ** 0.5,
    "hands and fingers": 2 * 140.0 / (0.5759 * 75_000.0) ** 0.5,
    "thighs and knees": 2 * 220.0 / (12.0455 * 50_000.0) ** 0.5,
    "lower legs": 2 * 130.0 / (12.0455 * 60_000.0) ** 0.5,
}
"""With 1 cm^2 the pressure limits skull, neck, back and chest, the force all others."""


@pytest.mark.parametrize("name", sorted(REGIONS))
def test_a_region_s_contact_speed_is_that_of_the_formula_by_hand(name):
    assert contact_speed(REGIONS[name], 14.35, 1.0) == pytest.approx(BY_HAND[name], rel=1e-4)


def test_the_numbers_by_hand_are_the_expected_sizes():
    assert BY_HAND["hands and fingers"] == pytest.approx(1.347, abs=1e-3)
    assert BY_HAND["chest"] == pytest.approx(0.467, abs=1e-3)
    assert BY_HAND["face"] == pytest.approx(0.129, abs=1e-3)


def test_a_larger_contact_helps_only_where_pressure_counts():
    chest, hand = REGIONS["chest"], REGIONS["hands and fingers"]
    assert contact_speed(chest, 14.35, 2.0) == pytest.approx(
        contact_speed(chest, 14.35, 1.0) * 140.0 / 120.0
    )
    assert contact_speed(hand, 14.35, 2.0) == contact_speed(hand, 14.35, 1.0)


def test_a_heavier_load_must_be_moved_more_slowly():
    speeds = [capsule_contact_speeds(14.35 + load, 1.0) for load in (0.0, 5.0, 10.0)]
    assert (speeds[0] > speeds[1]).all()
    assert (speeds[1] > speeds[2]).all()


def test_a_head_is_as_delicate_as_its_face_and_a_cylinder_as_any_part():
    speeds = capsule_contact_speeds(14.35, 1.0)
    assert speeds[body.C_HEAD] == pytest.approx(BY_HAND["face"], rel=1e-4)
    assert speeds[body.C_HAND_R] == speeds[body.C_HAND_L]
    assert speeds[body.C_LEG_R] == pytest.approx(BY_HAND["lower legs"], rel=1e-4)
    assert cylinder_contact_speed(14.35, 1.0) == pytest.approx(speeds.min())


def test_the_kernels_get_the_limits_of_load_and_contact_area_by_hand():
    """With 5 kg, m_R = 28.7 kg / 2 + 5 kg = 19.35 kg; with 2 cm^2 every force counts."""
    pelvis, abdomen = 2 * 180.0 / (13.0413 * 25e3) ** 0.5, 2 * 110.0 / (13.0413 * 10e3) ** 0.5
    chest, face = 2 * 140.0 / (13.0413 * 25e3) ** 0.5, 65.0 / (3.58484 * 75e3) ** 0.5
    upper_arm, forearm = 300.0 / (2.59732 * 30e3) ** 0.5, 320.0 / (1.81265 * 40e3) ** 0.5
    hand, lower_leg = 280.0 / (0.581955 * 75e3) ** 0.5, 260.0 / (15.38156 * 60e3) ** 0.5
    worker = [pelvis, abdomen, chest, face, *2 * [upper_arm], *2 * [forearm]]
    worker += [*2 * [hand], *2 * [lower_leg]]
    loaded = SafetySettings(pfl=True, load=5.0, contact_area=2.0)
    np.testing.assert_allclose(contact_speeds(loaded, 12, 1), [*worker, face], rtol=1e-5)
    two = contact_speeds(loaded, 24, 2)
    np.testing.assert_allclose(two, [*worker, *worker, face, face], rtol=1e-5)
    assert not contact_speeds(SafetySettings(load=5.0, contact_area=2.0), 12, 1).any()


def test_the_moving_mass_is_that_of_the_robot_s_model():
    moving = sum(inertia.mass for inertia in list(Robot().model.inertias)[1:])
    assert contact_limits.UR10_MOVING_MASS == pytest.approx(moving, abs=0.05)
