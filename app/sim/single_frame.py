"""A person from one frame of key-points, without history.

What is missing is not carried on from anywhere: those joints rest as they do in a person who
stands (``held``), the cylinder widens to where they can be, and speeds are zero unless the
key-points come with their own. For streams: ``people_estimate.py``.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from app.errors import InvalidInput
from app.sim.keypoint_angles import joint_motion
from app.sim.keypoint_cylinder import safety_cylinder
from app.sim.keypoints import N_KEYPOINTS, Group, check_keypoints, swap_sides
from app.sim.person_estimate import EstimatorSettings, PersonEstimate, PersonEstimator
from app.sim.ports import Person, Vec

_EXCHANGED: dict[str, Group] = {"arms-swapped": "arms", "legs-swapped": "legs"}
_STEP_S = 0.005
"""Step of the derivative of the cylinder's centre [s]."""


def estimate_once(
    keypoints: ArrayLike,
    size: Vec,
    confidences: ArrayLike | None = None,
    velocities: ArrayLike | None = None,
    place: str = "",
) -> PersonEstimate:
    """Return what one frame tells of a person.

    Args:
        keypoints: Order of BODY_25, cell's frame [m], shape (25, 3); NaN where missing.
        size: The person's size [m], shape (12,).
        confidences: Trust in each in [0, 1], shape (25,); 1 where None.
        velocities: Velocities of the key-points [m/s], shape (25, 3), NaN where unknown.
        place: Put before the field's name in errors, such as ``"people[1]."``.

    Raises:
        InvalidInput: See :func:`~app.sim.keypoints.check_keypoints`; or nothing is seen.
    """
    settings = EstimatorSettings()
    frame = check_keypoints(keypoints, confidences, settings.min_confidence, place)
    if not frame.seen.any():
        rule = "must show at least one key-point, or leave the person out"
        raise InvalidInput(f"{place}keypoints", "all missing", rule)
    estimator = PersonEstimator(size, settings)
    estimate = estimator.update(0.0, frame.points, frame.confidences)
    estimate = replace(estimate, strays=frame.strays)
    if velocities is None:
        return estimate
    given = np.array(velocities, dtype=np.float64)
    if given.shape != (N_KEYPOINTS, 3):
        rule = f"must have the shape {(N_KEYPOINTS, 3)}"
        raise InvalidInput(f"{place}velocities", given.shape, rule)
    for flag, group in _EXCHANGED.items():
        if flag in estimate.flags:
            given = swap_sides(given, group)
    return _moving(estimate, estimator.expected(0.0), np.nan_to_num(given), settings)


def _moving(
    estimate: PersonEstimate, points: Vec, speeds: Vec, settings: EstimatorSettings
) -> PersonEstimate:
    """Return the estimate with the speeds that its key-points have."""
    person = estimate.person
    if person is not None and person.size is not None:
        q, qd, _ = joint_motion(points, speeds, person.q, person.size, settings.qd_max)
        estimate = replace(estimate, person=Person(q=q, qd=qd, size=person.size))
    centers = [
        safety_cylinder(points + s * speeds, None, settings.cylinder)
        for s in (-_STEP_S, _STEP_S)
    ]
    before, after = centers
    if estimate.cylinder is None or before is None or after is None:
        return estimate
    velocity = (after.center - before.center) / (2.0 * _STEP_S)
    return replace(estimate, cylinder=replace(estimate.cylinder, velocity=velocity))
