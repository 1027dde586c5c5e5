"""Estimate of a person from one frame of key-points, without history.

Joints without key-points have the angles of a standing person (``held``), the cylinder widens
to the reach of missing points, and speeds are zero unless the key-points have their own. For
streams: ``multi_person_tracker.py``.

A frame always shows a person. Without usable key-points (``never-seen``), or in another frame
or unit (``foreign-frame``), the position is unknown; the cylinder then has the largest radius
around the robot's base, so that monitoring stops the robot.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from app.sim.core.arrays import Vec
from app.sim.human.person import Person
from app.sim.perception.bounding_cylinder import ABOVE_ROBOT, SafetyCylinder, safety_cylinder
from app.sim.perception.keypoint_angles import joint_motion
from app.sim.perception.keypoint_check import as_numbers, check_keypoints
from app.sim.perception.keypoints import BODY_25, N_KEYPOINTS, Group, swap_sides
from app.sim.perception.person_estimator import QD_MAX, PersonEstimate, PersonEstimator

_EXCHANGED: dict[str, Group] = {"arms-swapped": "arms", "legs-swapped": "legs"}
FASTEST_POINT = 20.0
"""Speed of a key-point beyond which its velocity is no person's [m/s]."""
_ANYWHERE = SafetyCylinder(
    center=np.zeros(2), radius=5.0, bottom=-5.0, top=ABOVE_ROBOT, velocity=np.zeros(2)
)
"""Cylinder of a person at an unknown place."""
_STEP_S = 0.005
"""Step of the derivative of the cylinder's centre [s]."""


def estimate_once(
    keypoints: ArrayLike,
    size: Vec,
    confidences: ArrayLike | None = None,
    velocities: ArrayLike | None = None,
    place: str = "",
    floor_z: float | None = None,
) -> PersonEstimate:
    """Return the estimate of a person from one frame.

    Args:
        keypoints: Order of BODY_25, cell's frame [m], shape (25, 3); NaN where missing.
        size: The person's size [m], shape (12,).
        confidences: Trust in each in [0, 1], shape (25,); 1 where None.
        velocities: Velocities of the key-points [m/s], shape (25, 3), NaN where unknown.
        place: Put before the field's name in errors, such as ``"people[1]."``.
        floor_z: Height of the floor [m]; None: heights over it are not judged.

    Raises:
        InvalidInput: Not numbers, or another shape.
    """
    frame = check_keypoints(keypoints, confidences, place, floor_z)
    speeds, wrong = _velocities(velocities, place)
    frame = replace(frame, unusable=frame.unusable + wrong)
    estimator = PersonEstimator(size)
    estimator.take_frame(0.0, frame)
    estimate = estimator.at(0.0)
    if estimate.cylinder is None:
        return replace(estimate, cylinder=_ANYWHERE)
    if velocities is None:
        return estimate
    for flag, group in _EXCHANGED.items():
        if flag in estimate.flags:
            speeds = swap_sides(speeds, group)
    return _moving(estimate, estimator.expected(0.0), speeds)


def _velocities(velocities: ArrayLike | None, place: str) -> tuple[Vec, tuple[str, ...]]:
    """Return velocities [m/s], (25, 3), 0 where unknown, and names of those that cannot be."""
    if velocities is None:
        return np.zeros((N_KEYPOINTS, 3)), ()
    given = as_numbers(f"{place}velocities", velocities, (N_KEYPOINTS, 3))
    speeds = np.linalg.norm(np.clip(given, -1e9, 1e9), axis=1)
    known = speeds <= FASTEST_POINT  # False for NaN
    wrong = ~known & ~np.isnan(given).all(axis=1)
    given[~known] = 0.0
    return given, tuple(f"velocity of {BODY_25[int(k)]}" for k in np.flatnonzero(wrong))


def _moving(estimate: PersonEstimate, points: Vec, speeds: Vec) -> PersonEstimate:
    """Return the estimate with the speeds that its key-points have."""
    person = estimate.person
    if person is not None and person.size is not None:
        q, qd, _ = joint_motion(points, speeds, person.q, person.size, QD_MAX)
        estimate = replace(estimate, person=Person(q=q, qd=qd, size=person.size))
    before, after = (safety_cylinder(points + s * speeds) for s in (-_STEP_S, _STEP_S))
    if estimate.cylinder is None or before is None or after is None:
        return estimate
    velocity = (after.center - before.center) / (2.0 * _STEP_S)
    velocity *= min(1.0, FASTEST_POINT / max(float(np.linalg.norm(velocity)), 1e-9))
    return replace(estimate, cylinder=replace(estimate.cylinder, velocity=velocity))
