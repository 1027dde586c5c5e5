"""The coarse capsules of the features are those of the robot, rounded."""

import numpy as np

from app.sim.cells.cell import load_cell
from app.sim.pick.kernels.observation_workspace import (
    COARSE_LINK,
    COARSE_P0,
    COARSE_RADIUS,
    COARSE_SPAN,
    STANDARD_TOOL,
    UPPER_ARM_Y,
)
from app.sim.robot.capsules import load_robot_capsules
from app.sim.scene.scene import arm_of


def test_coarse_capsules_are_as_long_as_the_links() -> None:
    length, radius = STANDARD_TOOL
    robot = arm_of(load_cell("pick-and-place")).lengths
    links = [robot.upper_arm, robot.forearm, robot.wrist_1_offset, robot.wrist_2_length]
    links.append(robot.flange + length - radius)
    np.testing.assert_allclose(np.linalg.norm(COARSE_SPAN, axis=1), links, atol=0.003)


def test_coarse_capsules_are_as_wide_as_the_capsules_of_contacts() -> None:
    capsules = load_robot_capsules(*STANDARD_TOOL)
    for link, coarse in zip(COARSE_LINK, COARSE_RADIUS, strict=True):
        radii = capsules.radius[(capsules.link == link) & (capsules.radius > STANDARD_TOOL[1])]
        assert radii.min() - 0.001 <= coarse <= radii.max() + 0.001


def test_upper_arm_has_the_offset_of_its_tube() -> None:
    capsules = load_robot_capsules(*STANDARD_TOOL)
    tube = capsules.name.index("upper_arm_mid")
    assert COARSE_P0[0, 1] == UPPER_ARM_Y
    np.testing.assert_allclose(capsules.p0[tube, 1], UPPER_ARM_Y, atol=1e-4)
