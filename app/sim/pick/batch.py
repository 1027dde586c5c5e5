"""The pick scenario of thesis chapter 5: one robot, one person, cubes and docks.

:class:`PickBatch` steps many cells at once in compiled kernels (``pick/kernels/episode.py``);
the
functions below it do the same for one state, for the live cell and for deciding. Both use the
same kernels, so that what was trained is what acts.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from app.errors import InvalidInput
from app.sim.cells.cell import Cell, lacks_stations
from app.sim.core.arrays import Vec, as_kernel_array
from app.sim.core.kernels.rng import start_stream
from app.sim.geometry.segments import FAR
from app.sim.people.human_motion_config import USUAL, HumanMotionConfig
from app.sim.people.kernels.motion import record_palms
from app.sim.people.kernels.people import People, PeopleState, new_people_geometry
from app.sim.pick.kernels import episode as pick
from app.sim.pick.kernels import observation as features
from app.sim.pick.kernels.observation import N_FEATURES, N_WITH_BODY
from app.sim.pick.kernels.reward import RewardWeights
from app.sim.robot.actions import ActionSettings
from app.sim.robot.kernels import actions, kinematics
from app.sim.robot.kernels import arm as arm_kernel
from app.sim.robot.kernels.arm import CONTROLLED, Arm
from app.sim.robot.kernels.joints import JointState
from app.sim.scenario.batch import EnvBatch, Rows
from app.sim.scenario.kernels.episode import FEATURES, PLAIN, distance_to
from app.sim.scene.scene import (
    HumanKind,
    arm_of,
    new_people_state,
    people_of,
    require_finite,
    with_people,
)

OUTCOMES = ("running", "success", "collision", "timeout", "unfeasible")
StartRule = Literal["clearance", "uniform"]
DEFAULT_ACTION = ActionSettings()
VIEWS = {
    "state": (PLAIN, pick.N_PLAIN),
    "features": (FEATURES, N_FEATURES),
    "body": (FEATURES, N_WITH_BODY),
}
"""What observations hold, and their lengths: the plain state of (5.8); that and features; those
and the person's size."""
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
    people: tuple[HumanKind, ...] | None = None
    """Who is in the cell, 0 to 4 people; None for the cell's own."""
    work: HumanMotionConfig = field(default=USUAL)
    """What the workers do: their motion, sizes and yielding."""
    start: StartRule = "clearance"
    """Where people may start: ``clearance`` (``start_clearance_m`` from the robot), ``uniform``
    (anywhere, even in contact)."""
    action: ActionSettings = field(default=DEFAULT_ACTION)
    """What actions mean (METHOD 2.2)."""
    observation: Literal["features", "state", "body"] = "features"
    """What policies see: the plain state of (5.8), that and features, or the person's size
    too."""
    weights: RewardWeights = field(default=DEFAULT_WEIGHTS)
    """Reward coefficients (METHOD 3.3)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """One control period of the robot: ``q(x) = q + qd x + c x^2 + d x^3``."""

    c: Vec
    """Second coefficients [rad/s^2], shape (6,)."""
    d: Vec
    """Third coefficients [rad/s^3], shape (6,)."""
    q: Vec
    """Joint positions at the end [rad], shape (6,)."""
    qd: Vec
    """Joint speeds at the end [rad/s], shape (6,)."""
    qdd: Vec
    """Joint accelerations at the end [rad/s^2], shape (6,)."""


def _world_of(cell: Cell, settings: PickSettings) -> pick.PickWorld:
    if (lack := lacks_stations(cell)) is not None:
        raise InvalidInput("cell", cell.name, f"cannot be used for picking: it {lack}")
    arm, stations = arm_of(cell), cell.pick_stations
    positions = np.array([station.position for station in stations]).reshape(-1, 3)
    postures, reached = kinematics.ik_vertical_batch(arm.lengths, arm.limits, positions)
    for station, found in zip(stations, reached, strict=True):
        if not found:
            raise InvalidInput(
                f"stations.{station.id}.position",
                station.position,
                "must be reachable by the robot with its tool pointing down",
            )
    return pick.PickWorld(
        stations=positions,
        station_q=postures,
        n_cubes=len(cell.stations_of("cube")),
        arm=arm,
        people=people_of(cell, settings.work),
    )


def _rules_of(settings: PickSettings) -> pick.PickRules:
    return pick.PickRules(
        time_limit=settings.time_limit_s,
        short_limit=settings.short_limit_s,
        short_share=settings.short_share,
        start_clearance=settings.start_clearance_m if settings.start == "clearance" else -FAR,
        target_jitter=settings.target_jitter_m,
        way_share=settings.way_share,
        n_candidates_min=settings.n_candidates[0],
        n_candidates_max=settings.n_candidates[1],
    )


def _new_state(world: pick.PickWorld, people: PeopleState, n_envs: int) -> pick.PickState:
    def rows(*shape: int) -> Vec:
        return np.zeros((n_envs, *shape))

    def counts(*shape: int) -> NDArray[np.int64]:
        return np.zeros((n_envs, *shape), dtype=np.int64)

    return pick.PickState(
        q=rows(6),
        qd=rows(6),
        qdd=rows(6),
        robot=np.repeat(world.arm.columns[None], n_envs, axis=0),
        people=people,
        goal=rows(3),
        q_goal=rows(6),
        candidates=counts(pick.MAX_CANDIDATES),
        time_left=rows(),
        elapsed=rows(),
        distance=rows(),
        tilt=rows(),
        episode=counts(),
        outcome=counts(),
        clear=rows(3),
        n_redrawn=counts(),
    )


class PickBatch(EnvBatch):
    """Many independent pick cells, stepped together by one thread.

    Args:
        cell: Work cell.
        n_envs: Number of cells.
        seed: Seed; episode ``k`` of cell ``e`` is fixed by (seed, e, k).
        settings: Starts, ends and rewards.
        first_env: Number of the first cell: rows of a batch that starts at ``k`` equal rows
            ``k`` and on of a batch that starts at 0, bit for bit.
    """

    _kernel = pick

    def __init__(
        self, cell: Cell, n_envs: int, seed: int, settings: PickSettings, first_env: int = 0
    ) -> None:
        self.cell = cell if settings.people is None else with_people(cell, settings.people)
        self.settings, self.world = settings, _world_of(self.cell, settings)
        self.arm = self.world.arm
        people = new_people_state(self.cell, self.world.people, n_envs)
        self.state = _new_state(self.world, people, n_envs)
        super().__init__(
            (
                self.world,
                _rules_of(settings),
                settings.action.rule(),
                settings.weights,
                self.state,
                pick.new_work(self.world, self.state),
            ),
            n_envs=n_envs,
            n_act=CONTROLLED,
            seed=seed,
            first_env=first_env,
            view=VIEWS[settings.observation],
        )

    def _observe(self, rows: Rows, out: NDArray[np.float32]) -> None:
        self._call(pick.observe_rows, self.world, self.state, rows, self._work, self._view, out)

    def set_goals(self, rows: Rows, goals: Vec) -> None:
        """Send the robots of ``rows`` to new targets [m], shape (len(rows), 3)."""
        for row, goal in zip(rows, goals, strict=True):
            pick.set_goal(
                self.world, self.state, int(row), as_kernel_array(goal), self._work.robot
            )


def observe(
    arm: Arm,
    people: People,
    q: Vec,
    qd: Vec,
    human_q: Vec,
    human_qd: Vec,
    goals: Vec,
    time_left_s: float,
    size: Vec | None = None,
    n_obs: int = N_FEATURES,
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return what the networks see of one state for each of n targets.

    Args:
        arm: From :func:`~app.sim.scene.scene.arm_of`.
        people: From :func:`~app.sim.scene.scene.people_of`.
        q: Robot joint positions [rad], shape (6,).
        qd: Robot joint speeds [rad/s], shape (6,).
        human_q: The person's joint positions [m, rad], shape (18,).
        human_qd: The person's joint speeds [m/s, rad/s], shape (18,).
        goals: Targets [m], shape (n, 3).
        time_left_s: Time left [s].
        size: The person's size [m], shape (body.N_SIZE,); None for the cell's person.
        n_obs: N_FEATURES, or N_WITH_BODY for networks that see the person's size.

    Returns:
        Observations, shape (n, n_obs), and whether each target is reachable, (n,).
    """
    n, targets = len(goals), as_kernel_array(goals)
    q_goals, reachable = kinematics.ik_vertical_batch(arm.lengths, arm.limits, targets)
    obs = np.empty((n, n_obs), dtype=np.float32)
    features.observe_batch(
        arm,
        people.floor_z,
        np.tile(as_kernel_array(q), (n, 1)),
        np.tile(as_kernel_array(qd), (n, 1)),
        np.tile(as_kernel_array(human_q), (n, 1)),
        np.tile(as_kernel_array(human_qd), (n, 1)),
        np.tile(as_kernel_array(people.bodies[0] if size is None else size), (n, 1)),
        targets,
        q_goals,
        np.full(n, time_left_s, dtype=np.float64),
        obs,
    )
    return obs, reachable


def step_robot(
    arm: Arm, q: Vec, qd: Vec, qdd: Vec, act: Vec, action: ActionSettings = DEFAULT_ACTION
) -> Piece:
    """Move the robot through one control period.

    Args:
        arm: From :func:`~app.sim.scene.scene.arm_of`.
        q: Joint positions [rad], shape (6,).
        qd: Joint speeds [rad/s], shape (6,).
        qdd: Joint accelerations [rad/s^2], shape (6,); only degree 3 reads them.
        act: Action in [-1, 1], shape (5,).
        action: What it means.

    Raises:
        SimulationError: A number is NaN or infinite.
    """
    require_finite("q, qd, qdd, act", np.concatenate([q, qd, qdd, act]))
    segment = actions.Coefficients(np.empty(6), np.empty(6))
    end = JointState(np.empty(6), np.empty(6), np.empty(6))
    start = JointState(as_kernel_array(q), as_kernel_array(qd), as_kernel_array(qdd))
    commanded = np.array(act, dtype=np.float32)
    actions.advance(action.rule(), arm.limits, arm.dt, start, commanded, segment, end)
    return Piece(c=segment.c, d=segment.d, q=end.q, qd=end.qd, qdd=end.qdd)


def tool_state(arm: Arm, q: Vec, qd: Vec, goal: Vec) -> tuple[float, float, float, bool]:
    """Return distance to a target [m], tilt [rad], tcp speed [m/s] and whether it succeeds."""
    pose = arm_kernel.new_robot_pose(arm)
    arm_kernel.place_robot(arm, as_kernel_array(q), pose)
    distance, tilt = distance_to(as_kernel_array(goal), pose), arm_kernel.robot_tilt(pose)
    speed = arm_kernel.tcp_speed(pose, as_kernel_array(qd))
    return distance, tilt, speed, bool(pick.succeeded(distance, tilt, speed))


def hand_speeds(
    batch: PickBatch, n_scripts: int = 200, seconds: float = 10.0
) -> dict[str, float]:
    """Return how fast the workers' hands are, both hands, while faster than 0.05 m/s [m/s].

    Args:
        batch: The scenario whose person is meant.
        n_scripts: Scripts looked at.
        seconds: Time looked at per script [s].
    """
    people, tick = batch.world.people._replace(yielding=0.0), 0.01
    state = new_people_state(batch.cell, people, 1)
    n_workers = state.q.shape[1]
    crowd = new_people_geometry(people, n_workers, state.cylinders.shape[1])
    palms, rng = np.zeros((int(seconds / tick), n_workers, 2, 3)), np.zeros(1, dtype=np.uint64)
    rates = []
    for number in range(n_scripts):
        start_stream(batch.seed, 1 << 20, number, rng)
        record_palms(people, state, rng, batch.arm.columns, tick, crowd, palms)
        rates.append(np.linalg.norm(np.diff(palms, axis=0), axis=-1).ravel() / tick)
    speeds = np.concatenate(rates)
    moving = speeds[speeds > 0.05]
    if not moving.size:  # Nobody works there, or nobody moves.
        return {}
    return {
        "hand_speed_median_m_s": float(np.median(moving)),
        "hand_speed_p99_m_s": float(np.percentile(moving, 99)),
        "hand_moving_share": len(moving) / len(speeds),
    }
