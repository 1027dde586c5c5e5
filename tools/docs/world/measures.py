"""Measurements of ``docs/world.md``: numbers for its JSON file, arrays for its pictures.

Seeded. Called by ``world/page.py``.
"""

from dataclasses import dataclass

import numpy as np

from app.sim.cell_validation.reachability import Reach
from app.sim.cells.cell import Cell, load_cell
from app.sim.collision.fcl_recheck import robot_ends
from app.sim.geometry.capsules import ends_of
from app.sim.people.kernels.pedestrian import WALKING
from app.sim.people.pedestrian import PedestrianSettings
from app.sim.pick.batch import step_robot
from app.sim.robot.actions import ActionSettings
from app.sim.robot.capsules import TOOL, load_robot_capsules
from app.sim.robot.kernels.arm import Arm, new_robot_pose, place_robot
from app.sim.robot.kernels.kinematics import tcp_jacobian
from app.sim.robot.ur10 import Robot
from app.sim.scene.scene import arm_of
from tests.sim.configurations import CHUNK, N, configurations
from tests.sim.fast_hands import HAND_SPEED, passes
from tests.sim.mesh_gap import FARTHEST, Gap, gaps
from tools.docs.results import Json
from tools.docs.world.walks import Walk, walk

POSTURES = 2000
"""Number of configurations for the comparison of capsules and meshes."""
EPISODES, PERIODS, HOLD = 40, 250, 15
"""Number of random episodes, their periods, and periods per constant action."""
PER_PERIOD = 8
"""Samples of speeds and accelerations per period."""
PASSES = 400
"""Number of hands that pass the arm."""
HEIGHTS = (0.05, 0.12, 0.30, 0.35, 0.45)
"""Heights of the reachability maps above the table [m]."""
EXTENT, GRID = (-1.4, 1.4, -0.8, 1.4), 0.02
"""Limits of these maps (x min, x max, y min, y max) and grid spacing [m]."""


def references() -> Json:
    """Return the largest deviations of the kernels from Pinocchio and from numpy."""
    arm, robot, capsules = arm_of(load_cell()), Robot(), load_robot_capsules()
    pose, links = new_robot_pose(arm), 0.0
    q = np.random.default_rng(52).uniform(arm.limits.q_min, arm.limits.q_max, (N, 6))
    p0, p1 = robot_ends(robot, capsules, q)
    for row, start, end in zip(q, p0, p1, strict=True):
        place_robot(arm, row, pose)
        found = ends_of(pose.capsules, len(capsules.name))
        links = max(links, np.abs(found[:, 0] - start).max(), np.abs(found[:, 1] - end).max())
    pairs, overlaps = 0.0, 0
    for case in configurations():
        pairs = max(pairs, np.abs(case.d - case.expected).max())
        overlaps += int(case.clearance < 0.0)
    return {
        "capsules": len(capsules.name),
        "configurations": N,
        "pairs": N * case.d.size,
        "fcl_pairs": CHUNK * case.d.size + N,
        "overlapping": overlaps,
        "capsule_ends_m": float(links),
        "distances_m": float(pairs),
    }


def mesh_gap(seed: int) -> tuple[Json, list[Gap]]:
    """Return the distance between capsules and meshes [mm], and all configurations."""
    cell = load_cell()
    found = gaps(cell, arm_of(cell), POSTURES, seed)
    groups = {"all": found, "links": [one for one in found if one.nearest != TOOL]}
    numbers: Json = {"drawn": POSTURES, "nearer_than_m": FARTHEST}
    for name, group in groups.items():
        gap = np.array([1e3 * (one.meshes - one.capsules) for one in group])
        numbers[name] = {
            "n": len(gap),
            "mean_mm": float(gap.mean()),
            "median_mm": float(np.median(gap)),
            "p95_mm": float(np.percentile(gap, 95)),
            "max_mm": float(gap.max()),
            "min_mm": float(gap.min()),
        }
    return numbers, found


def fast_hands(seed: int) -> Json:
    """Return how many passing hands are detected, and how many too late."""
    found = list(passes(load_cell(), PASSES, seed))
    touching = [one for one in found if one.touching is not None]
    late = [
        one.reported is None or one.reported > (one.touching or 0.0) + 1e-3 for one in touching
    ]
    return {
        "speed_m_s": HAND_SPEED,
        "periods": len(found),
        "touching": len(touching),
        "clear_at_ends": sum(one.clear_at_ends for one in touching),
        "late": sum(late),
        "only_capsules": sum(
            one.touching is None and one.reported is not None for one in found
        ),
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class Episode:
    """One episode of random actions, sampled several times per period."""

    time: np.ndarray
    """Time [s], shape (n,)."""
    q: np.ndarray
    """Joint positions [rad], shape (n, 6)."""
    qd: np.ndarray
    """Speeds [rad/s], shape (n, 6)."""
    qdd: np.ndarray
    """Accelerations [rad/s^2], shape (n, 6)."""
    jerk: np.ndarray
    """Jerks [rad/s^3], shape (n, 6); 0 inside the periods of degree 2."""


def episode(arm: Arm, degree: int, seed: int) -> Episode:
    """Return an episode in which each joint is pushed in changing directions."""
    rng, action = np.random.default_rng(seed), ActionSettings(degree=degree)
    q, qd, qdd = arm.home.copy(), np.zeros(6), np.zeros(6)
    x = (np.arange(PER_PERIOD) + 1.0)[:, None] * (arm.dt / PER_PERIOD)
    rows: list[tuple[np.ndarray, ...]] = []
    for period in range(PERIODS):
        if period % HOLD == 0:
            act = rng.choice([-1.0, 1.0, rng.uniform(-1.0, 1.0)], 6)
        segment = step_robot(arm, q, qd, qdd, act, action)
        c, d = segment.c, segment.d
        rows.append(
            (
                period * arm.dt + x[:, 0],
                q + x * (qd + x * (c + x * d)),
                qd + x * (2.0 * c + 3.0 * x * d),
                2.0 * c + 6.0 * x * d,
                np.tile(6.0 * d, (PER_PERIOD, 1)),
            )
        )
        q, qd, qdd = segment.q, segment.qd, segment.qdd
    joined = [np.concatenate(parts) for parts in zip(*rows, strict=True)]
    return Episode(time=joined[0], q=joined[1], qd=joined[2], qdd=joined[3], jerk=joined[4])


def limits(seed: int) -> tuple[Json, Arm, dict[int, Episode]]:
    """Return the extremes of random episodes relative to the limits, and one per degree."""
    arm = arm_of(load_cell("shared-workspace"))
    numbers: Json = {"cell": "shared-workspace", "dt_s": arm.dt}
    numbers |= {"episodes": EPISODES, "periods": PERIODS}
    shown: dict[int, Episode] = {}
    for degree in (2, 3):
        worst = {"q_over_rad": -np.inf, "qd_share": 0.0, "qdd_share": 0.0, "jerk_share": 0.0}
        for number in range(EPISODES):
            one = episode(arm, degree, seed + number)
            shown.setdefault(degree, one)
            over = np.maximum(one.q - arm.limits.q_max, arm.limits.q_min - one.q).max()
            worst["q_over_rad"] = max(worst["q_over_rad"], float(over))
            pairs = (
                ("qd", arm.limits.qd_max),
                ("qdd", arm.limits.qdd_max),
                ("jerk", arm.limits.jerk_max),
            )
            for name, limit in pairs:
                share = float((np.abs(getattr(one, name)) / limit).max())
                worst[f"{name}_share"] = max(worst[f"{name}_share"], share)
        numbers[f"degree_{degree}"] = worst
    return numbers, arm, shown


def walker(seed: int, seconds: float = 15.0) -> tuple[Json, Walk, PedestrianSettings]:
    """Return the ranges of speed and radius over many walks, and an example.

    The walk returned is the first that never stays and is both clipped and stands at times.
    """
    settings = PedestrianSettings()
    many = [walk(settings, seed, seconds, episode=k) for k in range(200)]
    speeds = [np.hypot(*one.velocity.T) for one in many]
    shown = next(
        one
        for one, speed in zip(many, speeds, strict=True)
        if (one.gait == WALKING).all() and speed.min() == 0.0 and speed.max() > 0.999
    )
    speed = np.concatenate(speeds)
    radius = np.concatenate([one.radius for one in many])
    place = np.concatenate([one.position for one in many])
    numbers = {
        "walks": len(many),
        "seconds": seconds,
        "bounds_m_s": [settings.v_min, settings.v_max],
        "speed_m_s": [float(speed[speed > 0.0].min()), float(speed.max())],
        "standing_share": float((speed == 0.0).mean()),
        "radius_m": [float(radius.min()), float(radius.max())],
        "x_m": [float(place[:, 0].min()), float(place[:, 0].max())],
        "y_m": [float(place[:, 1].min()), float(place[:, 1].max())],
    }
    return numbers, shown, settings


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachMap:
    """Positions with the tool pointing down at one height."""

    z: float
    """Height above the table [m]."""
    slowest: np.ndarray
    """TCP speed in the slowest direction per joint speed [m/rad], shape (ny, nx); NaN if
    unreachable."""
    blocked: np.ndarray
    """Whether all configurations touch table or robot, shape (ny, nx)."""


def grid() -> tuple[np.ndarray, np.ndarray]:
    """Return the cell centres of the maps along x and y [m]."""
    left, right, near, far = EXTENT
    xs = np.arange(left + 0.5 * GRID, right, GRID)
    return xs, np.arange(near + 0.5 * GRID, far, GRID)


def reach_map(cell: Cell, z: float) -> ReachMap:
    """Return the reachability of a cell's robot at a height, tool pointing down."""
    reach, arm, robot = Reach(cell), arm_of(cell), Robot(cell.robot.tool_length)
    pose = new_robot_pose(arm)
    xs, ys = grid()
    slowest = np.full((len(ys), len(xs)), np.nan)
    blocked = np.zeros(slowest.shape, dtype=bool)
    for i, j in np.ndindex(slowest.shape):
        point = np.array([xs[j], ys[i], z])
        found = reach.tool_down(point).q
        if found is None:
            blocked[i, j] = (
                robot.ik_vertical(point, arm.limits.q_min, arm.limits.q_max) is not None
            )
            continue
        place_robot(arm, found, pose)
        tcp_jacobian(pose.rot, pose.pos, pose.tcp, pose.jacobian)
        slowest[i, j] = np.linalg.svd(pose.jacobian, compute_uv=False)[-1]
    return ReachMap(z=z, slowest=slowest, blocked=blocked)


def reach() -> tuple[Json, list[ReachMap]]:
    """Return the maps at all heights, the reachable area and its share of the table."""
    cell = load_cell()
    maps, table, (xs, ys) = [reach_map(cell, z) for z in HEIGHTS], cell.table, grid()
    over = (xs >= table.x_min) & (xs <= table.x_max)
    over = over & ((ys >= table.y_min) & (ys <= table.y_max))[:, None]
    there = [np.isfinite(one.slowest) for one in maps]
    numbers = {
        "cell": cell.name,
        "grid_m": GRID,
        "heights_m": list(HEIGHTS),
        "area_m2": [float(one.sum()) * GRID**2 for one in there],
        "table_share": [float(one[over].mean()) for one in there],
    }
    return numbers, maps
