"""Speed limits of contact by body part (power and force limiting).

A free body part and the robot are two masses with a spring between them. If all energy of their
relative motion goes into the spring, the contact force stays below ``F`` for speeds up to
``v = F / sqrt(mu k)``, with the part's stiffness ``k`` and the reduced mass
``1/mu = 1/m_H + 1/m_R``, where ``m_R = M/2 + m_L`` is half of the robot's moving mass and its
load. A pressure limit ``p`` over a contact area ``a`` is a force ``p a``; the lesser counts.
The relative speed is taken as the robot's speed, with the person at rest.

Source: ISO/TS 15066:2016, annex A: table A.2 (forces, pressures, factors of transient contact)
and A.3 (masses, stiffnesses), eq. (A.3) to (A.6). The limits are those of the onset of pain.
Verify figures against the text of the standard, which is not freely available.
"""

import math
from dataclasses import dataclass

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.human.kernels import kinematics as body

UR10_MOVING_MASS = 28.7
"""Mass of the UR10 above its base [kg], the sum over its URDF's links."""


@dataclass(frozen=True, slots=True)
class Region:
    """One body region of tables A.2 and A.3."""

    name: str
    """Name in the tables."""
    force: float
    """Greatest permissible quasi-static force [N]."""
    pressure: float
    """Least of the region's greatest permissible quasi-static pressures [N/cm^2]."""
    transient: float
    """Factor by which both may be exceeded in transient contact; 1 where the table has none."""
    stiffness: float
    """Effective spring constant [N/mm]."""
    mass: float
    """Effective mass [kg]."""


REGIONS = {
    region.name: region
    for region in (
        Region("skull and forehead", 130.0, 110.0, 1.0, 150.0, 4.4),
        Region("face", 65.0, 110.0, 1.0, 75.0, 4.4),
        Region("neck", 150.0, 140.0, 2.0, 50.0, 1.2),
        Region("back and shoulders", 210.0, 160.0, 2.0, 35.0, 40.0),
        Region("chest", 140.0, 120.0, 2.0, 25.0, 40.0),
        Region("abdomen", 110.0, 140.0, 2.0, 10.0, 40.0),
        Region("pelvis", 180.0, 210.0, 2.0, 25.0, 40.0),
        Region("upper arms and elbow joints", 150.0, 190.0, 2.0, 30.0, 3.0),
        Region("lower arms and wrist joints", 160.0, 180.0, 2.0, 40.0, 2.0),
        Region("hands and fingers", 140.0, 190.0, 2.0, 75.0, 0.6),
        Region("thighs and knees", 220.0, 220.0, 2.0, 50.0, 75.0),
        Region("lower legs", 130.0, 210.0, 2.0, 60.0, 75.0),
    )
}
"""All regions by name. The skull's pressure is the temple's, the lesser of its two."""

_ARM = ("upper arms and elbow joints",)
_FOREARM = ("lower arms and wrist joints",)
_HAND = ("hands and fingers",)
_LEG = ("thighs and knees", "lower legs")
CAPSULE_REGIONS: tuple[tuple[str, ...], ...] = (
    ("pelvis",),
    ("abdomen",),
    ("chest", "back and shoulders"),
    ("skull and forehead", "face", "neck"),
    _ARM,
    _ARM,
    _FOREARM,
    _FOREARM,
    _HAND,
    _HAND,
    _LEG,
    _LEG,
)
"""Regions that each of a worker's capsules covers; the most delicate one counts."""


def contact_speed(region: Region, robot_mass: float, contact_area: float) -> float:
    """Return the greatest speed of a transient contact with a region [m/s].

    Args:
        robot_mass: Effective mass of the robot, M/2 + m_L [kg].
        contact_area: Area over which the robot touches [cm^2].
    """
    force = region.transient * min(region.force, region.pressure * contact_area)
    reduced_mass = 1.0 / (1.0 / region.mass + 1.0 / robot_mass)
    return force / math.sqrt(reduced_mass * 1000.0 * region.stiffness)


def capsule_contact_speeds(robot_mass: float, contact_area: float) -> Vec:
    """Return the greatest contact speed of each of a worker's capsules [m/s], shape (12,)."""
    speeds = [
        min(contact_speed(REGIONS[name], robot_mass, contact_area) for name in names)
        for names in CAPSULE_REGIONS
    ]
    assert len(speeds) == body.N_CAPSULES
    return np.array(speeds)


def cylinder_contact_speed(robot_mass: float, contact_area: float) -> float:
    """Return the limit of a cylinder: that of the most sensitive region [m/s]."""
    return min(contact_speed(region, robot_mass, contact_area) for region in REGIONS.values())
