"""How far estimates are from people at work who are seen through a tracker."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from app.sim.cells.cell import Cell
from app.sim.human import model as human
from app.sim.perception.bounding_cylinder import SafetyCylinder, safety_cylinder
from app.sim.perception.keypoint_sensor_model import (
    KeypointSensorModel,
    KeypointSensorSettings,
    Motion,
)
from app.sim.perception.keypoints import keypoints_of
from app.sim.perception.person_estimator import PersonEstimate, PersonEstimator
from tests.sim.perception.cylinder_contents import holds
from tests.sim.tracked_person import RATE_HZ, cell_of, motion, work

SECONDS = 12.0
SEEDS = (1, 2, 3)


@dataclass(frozen=True)
class Errors:
    center: list[float] = field(default_factory=list)
    """Distance of the cylinder's axis from that of exact key-points [m]."""
    contains: list[bool] = field(default_factory=list)
    """Whether every joint centre is inside."""
    surface: list[bool] = field(default_factory=list)
    """Whether every capsule of the body is inside."""
    wrist: list[float] = field(default_factory=list)
    """Distance of the wrists of the joint angles from the true ones [m]."""
    points: list[float] = field(default_factory=list)
    """Median distance of the model's fourteen points from the true ones [m]."""
    velocity: list[float] = field(default_factory=list)
    """Error of the axis's velocity [m/s]."""
    qd: list[np.ndarray] = field(default_factory=list)
    """Error of the joint speeds [m/s, rad/s]."""


def follow(
    motion: Motion,
    times: Sequence[float],
    tracker: KeypointSensorModel,
    estimator: PersonEstimator,
) -> Iterator[PersonEstimate]:
    """Yield the estimate of a person at each time [s], from simulated frames."""
    for t in times:
        for frame in tracker.frames(t, motion):
            estimator.take(frame.t, frame.keypoints, frame.confidences)
        yield estimator.at(t)


@lru_cache(maxsize=16)
def errors(
    settings: KeypointSensorSettings, percentile: float = 50.0, assumed: float | None = None
) -> Errors:
    """Compare three people at work for 12 s with what a tracker makes of them.

    Args:
        settings: The tracker.
        percentile: Of the people's stature, arms and shoulders.
        assumed: The same of the person that the estimator takes them for; None: it knows.
    """
    found, cell = Errors(), cell_of(percentile)
    taken_for = cell if assumed is None else cell_of(assumed)
    for seed in SEEDS:
        times, q, qd = work(seed, SECONDS, percentile)
        tracker = KeypointSensorModel(settings, seed, cell.body, cell.floor_z)
        estimator = PersonEstimator(taken_for.body)
        estimates = follow(motion(seed, SECONDS, percentile), times, tracker, estimator)
        for k, estimate in enumerate(estimates):
            if k / RATE_HZ >= settings.latency_s + 0.1:
                axis = true_axes(seed, percentile)[k]
                compare(cell, taken_for, estimate, (q[k], qd[k], *axis), found)
    return found


@lru_cache(maxsize=16)
def true_axes(seed: int, percentile: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Centre [m] and velocity [m/s] of the axis of exact key-points at each time."""
    cell, (_, q, qd) = cell_of(percentile), work(seed, SECONDS, percentile)
    found = []
    for k in range(len(q)):
        true, before, after = (
            safety_cylinder(keypoints_of(q[k] + s * qd[k], cell.body, cell.floor_z))
            for s in (0.0, -0.01, 0.01)
        )
        assert true is not None and before is not None and after is not None
        found.append((true.center, (after.center - before.center) / 0.02))
    return found


def compare(
    cell: Cell,
    taken_for: Cell,
    estimate: PersonEstimate,
    true: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    found: Errors,
) -> None:
    """Add the errors of one estimate; the truth is joints, their speeds, axis and velocity."""
    assert estimate.person is not None and estimate.cylinder is not None
    q, qd, center, velocity = true
    body = human.joint_points(q, cell.body)
    fitted = human.joint_points(estimate.person.q, taken_for.body)
    found.center.append(float(np.linalg.norm(estimate.cylinder.center - center)))
    found.contains.append(holds(estimate.cylinder, np.array(list(body.values()))))
    found.surface.append(holds_surface(estimate.cylinder, cell, q))
    found.wrist.extend(
        float(np.linalg.norm(body[name] - fitted[name])) for name in ("wrist_r", "wrist_l")
    )
    away = [float(np.linalg.norm(body[name] - fitted[name])) for name in human.POINT_NAMES]
    found.points.append(float(np.median(away)))
    found.velocity.append(float(np.linalg.norm(velocity - estimate.cylinder.velocity)))
    found.qd.append(np.abs(estimate.person.qd - qd))


def holds_surface(cylinder: SafetyCylinder, cell: Cell, q: np.ndarray) -> bool:
    """Whether a cylinder holds every capsule of a person."""
    ends = human.capsules(q, cell.body, cell.floor_z)
    radii = human.capsule_radii(cell.body)[:, None]
    away = np.linalg.norm(ends[:, :, :2] - cylinder.center, axis=2) + radii
    return bool(
        (away <= cylinder.radius).all() and (ends[..., 2] + radii <= cylinder.top).all()
    )
