"""The pick scenario of thesis chapter 5: one robot, one person, cubes and docks.

:class:`PickBatch` steps many cells at once in compiled kernels (``kernels/pick.py``); the
functions below it do the same for one state, for the live cell and for deciding. Both use the
same kernels, so that what was trained is what acts.
"""

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from app.errors import InvalidInput, SimulationError
from app.sim import human
from app.sim.cells import Cell, lacks_for_pick
from app.sim.kernels import arm as arm_kernel
from app.sim.kernels import body, features, kinematics, pick, random, script
from app.sim.kernels.arm import Arm
from app.sim.kernels.features import N_FEATURES
from app.sim.kernels.reward import RewardWeights
from app.sim.ports import Vec
from app.sim.shapes import levers, load_robot_capsules, self_pairs
from app.sim.work_cycle import build_library

OUTCOMES = ("running", "success", "collision", "timeout")
CONTACT_KINDS = ("none", "human", "cell", "self")
DEFAULT_WEIGHTS = RewardWeights(
    c_d=0.5, c_th=0.5, c_c=1.0, c_step=0.02, c_v=1.0, d_v=0.1, c_s=1.0, gamma=1.0
)
"""The source's coefficients (table 5.1, signs mended); d_v, printed nowhere, is ours."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PickSettings:
    """How episodes of the scenario start and end."""

    time_limit_s: float = 20.0
    """Longest episode [s] (table 5.2)."""
    short_limit_s: float = 10.0
    """Time left at the start of short episodes [s] (section 5.3.1)."""
    short_share: float = 0.0
    """Share of episodes that start with ``short_limit_s`` left."""
    start_clearance_m: float = 0.05
    """Least distance of robot and person at the start [m]."""
    target_jitter_m: float = 0.0
    """Targets are drawn from a box of this half width around their station [m]."""
    way_share: float = 0.0
    """Share of episodes that start part of the way to the target."""
    n_candidates: tuple[int, int] = (1, 1)
    """Fewest and most targets offered per episode."""
    human_pace: float = 1.0
    """Speed of the person relative to the work cycle."""
    library_seed: int = 0
    """Seed of the person's library of postures."""
    weights: RewardWeights = field(default=DEFAULT_WEIGHTS)
    """Reward coefficients (METHOD 3.3)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepResult:
    """What one batched step gave; the arrays are overwritten by the next step."""

    obs: NDArray[np.float32]
    """Observations after the step, of new episodes where one ended, (n_envs, N_FEATURES)."""
    last_obs: NDArray[np.float32]
    """Final observation of the rows that ended, (n_envs, N_FEATURES)."""
    rew: NDArray[np.float32]
    """Rewards, (n_envs,)."""
    ended: NDArray[np.int64]
    """Index into OUTCOMES of episodes that ended now, 0 elsewhere, (n_envs,)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """Result of the contact test of one period."""

    kind: str
    """One of CONTACT_KINDS."""
    clearance_m: float
    """Distance of robot and person at the pose of contact, or at the end [m]."""
    link: str
    """Robot capsule that touches, or is nearest to the person."""
    part: str
    """What it touches or is nearest to: a capsule of the person (CAPSULE_NAMES), ``table`` or
    another capsule of the robot."""


@lru_cache(maxsize=8)
def arm_of(cell: Cell) -> Arm:
    """Return what the kernels know of a cell's robot."""
    mount = cell.robot
    capsules = load_robot_capsules(mount.tool_length, mount.tool_radius)
    return Arm(
        q_min=np.array(mount.q_min),
        q_max=np.array(mount.q_max),
        qd_max=np.array(mount.qd_max),
        qdd_max=np.array(mount.qdd_max),
        home=np.array(mount.home_q),
        dt=mount.dt,
        tool_length=mount.tool_length,
        link=capsules.link,
        p0=capsules.p0,
        p1=capsules.p1,
        radius=capsules.radius,
        pairs=self_pairs(capsules),
        lever=levers(mount.tool_length, mount.tool_radius),
        pelvis_z=cell.pelvis_z,
        floor_z=cell.floor_z,
    )


def _require_finite(name: str, values: NDArray[np.floating]) -> None:
    """Raise SimulationError for NaN and infinity, which the contact test would pass over."""
    if not np.isfinite(values).all():
        raise SimulationError(f"{name} = {values.tolist()} must be finite")


def _own(values: ArrayLike) -> Vec:
    """Return a copy of one kind, float64, contiguous and writable.

    Kernels are compiled anew for read-only, strided or integer arrays: half a minute in the
    middle of a live cell.
    """
    return np.array(values, dtype=np.float64, order="C")


def _world_of(cell: Cell, library_seed: int) -> pick.PickWorld:
    mount = cell.robot
    if (lack := lacks_for_pick(cell)) is not None:
        raise InvalidInput("cell", cell.name, f"cannot be used for picking: it {lack}")
    stations = np.array([station.position for station in cell.pick_stations])
    postures, reached = kinematics.ik_vertical_batch(
        stations, mount.tool_length, np.array(mount.q_min), np.array(mount.q_max)
    )
    for station, found in zip(cell.pick_stations, reached, strict=True):
        if not found:
            raise InvalidInput(
                f"stations.{station.id}.position",
                station.position,
                "must be reachable by the robot with its tool pointing down",
            )
    library = build_library(cell, library_seed)
    return pick.PickWorld(
        stations=stations,
        station_q=postures,
        n_cubes=library.n_cubes,
        postures=library.postures,
        hands=library.hands,
        of_station=library.of_station,
    )


def _rules_of(settings: PickSettings) -> pick.PickRules:
    return pick.PickRules(
        time_limit=settings.time_limit_s,
        short_limit=settings.short_limit_s,
        short_share=settings.short_share,
        start_clearance=settings.start_clearance_m,
        target_jitter=settings.target_jitter_m,
        way_share=settings.way_share,
        n_candidates_min=settings.n_candidates[0],
        n_candidates_max=settings.n_candidates[1],
        human_pace=settings.human_pace,
    )


def _new_state(n_envs: int) -> pick.PickState:
    def rows(*shape: int) -> Vec:
        return np.zeros((n_envs, *shape))

    def counts(*shape: int) -> NDArray[np.int64]:
        return np.zeros((n_envs, *shape), dtype=np.int64)

    return pick.PickState(
        q=rows(6),
        qd=rows(6),
        human_q=rows(18),
        human_qd=rows(18),
        goal=rows(3),
        q_goal=rows(6),
        candidates=counts(pick.MAX_CANDIDATES),
        time_left=rows(),
        elapsed=rows(),
        phase=rows(),
        n_moves=counts(),
        start=rows(script.MAX_MOVES),
        duration=rows(script.MAX_MOVES),
        chosen=counts(script.MAX_MOVES + 1),
        episode=counts(),
        outcome=counts(),
        clearance=rows(),
        n_redrawn=counts(),
    )


class PickBatch:
    """Many independent pick cells, stepped together by one thread.

    Args:
        cell: Work cell.
        n_envs: Number of cells.
        seed: Seed; episode ``k`` of cell ``e`` is fixed by (seed, e, k).
        settings: Starts, ends and rewards.
    """

    def __init__(self, cell: Cell, n_envs: int, seed: int, settings: PickSettings) -> None:
        self.cell, self.n_envs, self.seed, self.settings = cell, n_envs, seed, settings
        self.arm = arm_of(cell)
        self.world = _world_of(cell, settings.library_seed)
        self.state = _new_state(n_envs)
        self._rules = _rules_of(settings)
        self._obs = np.zeros((n_envs, N_FEATURES), dtype=np.float32)
        self._last = np.zeros_like(self._obs)
        self._rew = np.zeros(n_envs, dtype=np.float32)
        self._ended = np.zeros(n_envs, dtype=np.int64)

    def reset(self, seed: int | None = None) -> NDArray[np.float32]:
        """Start episode 0 in every cell; return observations, (n_envs, N_FEATURES)."""
        self.seed = self.seed if seed is None else seed
        self.state.episode[:] = 0
        return self.restart()

    def restart(self) -> NDArray[np.float32]:
        """Start the episodes numbered by ``state.episode``; return the observations."""
        pick.reset_batch(self.world, self._rules, self.arm, self.seed, self.state, self._obs)
        return self._obs

    def step(
        self, act: NDArray[np.float32], *, auto_reset: bool = True, features: bool = True
    ) -> StepResult:
        """Move every cell through one control period.

        Args:
            act: Wanted joint speeds over their limits, in [-1, 1], shape (n_envs, 5).
            auto_reset: Start the next episode where one ended; else its row stands still.
            features: Whether observations are wanted.

        Raises:
            SimulationError: An action is NaN or infinite.
        """
        _require_finite("act", act)
        wanted = np.array(act, dtype=np.float32, order="C")
        pick.step_batch(
            self.world,
            self._rules,
            self.arm,
            self.settings.weights,
            self.seed,
            self.state,
            wanted,
            auto_reset,
            features,
            self._obs,
            self._last,
            self._rew,
            self._ended,
        )
        return StepResult(obs=self._obs, last_obs=self._last, rew=self._rew, ended=self._ended)

    def set_goals(self, rows: NDArray[np.int64], goals: Vec) -> None:
        """Send the robots of ``rows`` to new targets [m], shape (len(rows), 3)."""
        for row, goal in zip(rows, goals, strict=True):
            pick.set_goal(self.arm, self.state, int(row), _own(goal))


def observe(
    arm: Arm,
    q: Vec,
    qd: Vec,
    human_q: Vec,
    human_qd: Vec,
    goals: Vec,
    time_left_s: float,
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return what the networks see of one state for each of n targets.

    Args:
        arm: From :func:`arm_of`.
        q: Robot joint positions [rad], shape (6,).
        qd: Robot joint speeds [rad/s], shape (6,).
        human_q: The person's joint positions [m, rad], shape (18,).
        human_qd: The person's joint speeds [m/s, rad/s], shape (18,).
        goals: Targets [m], shape (n, 3).
        time_left_s: Time left [s].

    Returns:
        Observations, shape (n, N_FEATURES), and whether each target is reachable, (n,).
    """
    n, targets = len(goals), _own(goals)
    q_goals, reachable = kinematics.ik_vertical_batch(
        targets, arm.tool_length, arm.q_min, arm.q_max
    )
    obs = np.empty((n, N_FEATURES), dtype=np.float32)
    features.observe_batch(
        arm,
        np.tile(_own(q), (n, 1)),
        np.tile(_own(qd), (n, 1)),
        np.tile(_own(human_q), (n, 1)),
        np.tile(_own(human_qd), (n, 1)),
        targets,
        q_goals,
        np.full(n, time_left_s, dtype=np.float64),
        obs,
    )
    return obs, reachable


def step_robot(arm: Arm, q: Vec, qd: Vec, act: Vec) -> tuple[Vec, Vec, Vec]:
    """Move the robot through one control period.

    Args:
        arm: From :func:`arm_of`.
        q: Joint positions [rad], shape (6,).
        qd: Joint speeds [rad/s], shape (6,).
        act: Wanted joint speeds over their limits, in [-1, 1], shape (5,).

    Returns:
        Positions [rad] and speeds [rad/s] after the period and its coefficients [rad/s^2],
        each of shape (6,).

    Raises:
        SimulationError: A number is NaN or infinite.
    """
    _require_finite("q, qd, act", np.concatenate([q, qd, act]))
    c, q_out, qd_out = np.empty(6), np.empty(6), np.empty(6)
    pick.drive(arm, _own(q), _own(qd), _own(act), c, q_out, qd_out)
    return q_out, qd_out, c


def contact(arm: Arm, q0: Vec, qd0: Vec, c: Vec, human_q0: Vec, human_q1: Vec) -> Contact:
    """Test one control period for contact, between its ends too.

    Args:
        arm: From :func:`arm_of`.
        q0: Joint positions at the start [rad], shape (6,).
        qd0: Joint speeds at the start [rad/s], shape (6,).
        c: Coefficients of the period [rad/s^2], shape (6,).
        human_q0: The person's joints at the start [m, rad], shape (18,).
        human_q1: The person's joints at the end [m, rad], shape (18,).

    Raises:
        SimulationError: A number is NaN or infinite.
    """
    _require_finite("q, qd, c", np.concatenate([q0, qd0, c]))
    _require_finite("human_q", np.concatenate([human_q0, human_q1]))
    before, pose = arm_kernel.new_pose(len(arm.link)), arm_kernel.new_pose(len(arm.link))
    kind, link, part, d = arm_kernel.sweep(
        arm, _own(q0), _own(qd0), _own(c), _own(human_q0), _own(human_q1), before, pose
    )
    names = load_robot_capsules().name
    touching, other = names[link], human.CAPSULE_NAMES[part]
    if kind == arm_kernel.SELF_CONTACT:
        touching, other = (names[k] for k in arm.pairs[link])
    elif kind == arm_kernel.CELL_CONTACT:
        other = "table"
    return Contact(kind=CONTACT_KINDS[kind], clearance_m=d, link=touching, part=other)


def tool_state(arm: Arm, q: Vec, qd: Vec, goal: Vec) -> tuple[float, float, float, bool]:
    """Return distance to a target [m], tilt [rad], tcp speed [m/s] and whether it succeeds."""
    pose = arm_kernel.new_pose(len(arm.link))
    arm_kernel.place_robot(arm, _own(q), pose)
    distance, tilt, speed = pick.tool_state(arm, _own(qd), _own(goal), pose)
    return distance, tilt, speed, bool(pick.succeeded(distance, tilt, speed))


def hand_speeds(
    batch: PickBatch, n_scripts: int = 200, seconds: float = 10.0
) -> dict[str, float]:
    """Return how fast the person's hands are, both hands, while faster than 0.05 m/s [m/s].

    Args:
        batch: The scenario whose person is meant.
        n_scripts: Scripts looked at.
        seconds: Time looked at per script [s].
    """
    n, tick = n_scripts, 0.01
    chosen = np.zeros(script.MAX_MOVES + 1, dtype=np.int64)
    start, duration = np.zeros(script.MAX_MOVES), np.zeros(script.MAX_MOVES)
    points, frames = np.empty((body.N_POINTS, 3)), np.empty((body.N_FRAMES, 3, 3))
    stream, q, qd = np.zeros(1, dtype=np.uint64), np.empty(18), np.empty(18)
    world, rates = batch.world, []
    for number in range(n):
        random.start_stream(batch.seed, 1 << 20, number, stream)
        moves = script.draw_script(
            stream,
            world.of_station,
            len(world.stations),
            world.n_cubes,
            world.hands,
            -1,
            start,
            duration,
            chosen,
        )
        postures, palms = world.postures[chosen[: moves + 1]], []
        for k in range(int(seconds / tick)):
            script.script_at(k * tick, moves, start, duration, postures, q, qd)
            body.points_and_frames(q, batch.arm.pelvis_z, points, frames)
            palms.append(points[[body.HAND_R, body.HAND_L]])
        rates.append(np.linalg.norm(np.diff(np.array(palms), axis=0), axis=2) / tick)
    speeds = np.concatenate([rate.ravel() for rate in rates]) * batch.settings.human_pace
    moving = speeds[speeds > 0.05]
    return {
        "hand_speed_median_m_s": float(np.median(moving)),
        "hand_speed_p99_m_s": float(np.percentile(moving, 99)),
        "hand_moving_share": len(moving) / len(speeds),
    }
