"""The pick scenario of thesis chapter 5: a robot, up to four people, cubes and docks.

:class:`PickBatch` steps many environments in compiled kernels (``pick/kernels/episode.py``).
The functions evaluate one state with the same kernels, for the live world and task selection.
"""

import math
from dataclasses import dataclass, field
from typing import ClassVar, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from app.errors import InvalidInput
from app.sim.cells.cell import Cell, lacks_for_pick_episodes
from app.sim.core.arrays import Vec, as_kernel_array
from app.sim.core.jit import FAR
from app.sim.human import model as human
from app.sim.people.human_motion_config import USUAL, HumanMotionConfig
from app.sim.pick.kernels import episode, starts
from app.sim.pick.kernels.grasp import DESCEND, REACH_ONLY, GraspRules
from app.sim.pick.kernels.observation_layout import (
    N_FEATURES,
    N_PICK,
    N_WITH_BODY,
    N_WITH_PHASE,
)
from app.sim.pick.kernels.observation_workspace import (
    PickObservationWorkspace,
    PickQuery,
    new_pick_observation_workspace,
)
from app.sim.pick.kernels.reward import RewardWeights
from app.sim.prediction.weights import new_worker_predictor
from app.sim.robot.actions import ActionSettings
from app.sim.robot.kernels import actions, kinematics
from app.sim.robot.kernels import arm as arm_kernel
from app.sim.robot.kernels.arm import CONTROLLED, Arm
from app.sim.robot.kernels.joints import JointState
from app.sim.robot.trajectory_segment import TrajectorySegment
from app.sim.scenario.batch import EnvBatch
from app.sim.scenario.kernels.episode import (
    FEATURES,
    MAX_CANDIDATES,
    PLAIN,
    Indices,
    distance_to,
)
from app.sim.scene.scene import (
    FAR_AWAY,
    HumanKind,
    arm_of,
    new_people_state,
    people_of,
    require_finite,
    require_shape,
    with_people,
)

Flags = NDArray[np.bool_]
OUTCOMES = ("running", "success", "collision", "timeout", "unfeasible")
StartRule = Literal["clearance", "uniform"]
DEFAULT_ACTION = ActionSettings()
BOX_MARGIN = (0.1, 0.1, 0.02)
"""Margin of the box of other targets around the stations [m]."""
VIEWS = {
    "state": (PLAIN, episode.N_PLAIN),
    "features": (FEATURES, N_FEATURES),
    "body": (FEATURES, N_WITH_BODY),
    "phase": (FEATURES, N_WITH_PHASE),
    "two-people": (FEATURES, N_PICK),
}
"""Contents and lengths of observations: the raw state of thesis eq. (5.8); the state and
features; these and the person's body dimensions; state, features and the phase of the pick;
these and a second person."""
DEFAULT_WEIGHTS = RewardWeights(
    c_d=0.5, c_th=0.5, c_c=1.0, c_step=0.02, c_v=1.0, d_v=0.1, c_s=1.0, gamma=1.0
)
"""Coefficients of table 5.1 with corrected signs; the thesis does not print d_v."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PickSettings:
    """Settings of the pick scenario.

    Raises:
        InvalidInput: A rule is unknown, or a number is out of range.
    """

    time_limit_s: float = 20.0
    """Longest episode [s] (table 5.2)."""
    short_limit_s: float = 10.0
    """Time left at the start of short episodes [s] (section 5.3.1)."""
    short_share: float = 0.0
    """Share of episodes that start with ``short_limit_s`` left."""
    start_clearance_m: float = 0.05
    """Least clearance of robot and person at the start [m]."""
    target_jitter_m: float = 0.0
    """Targets are drawn from a box of this half width around their station [m]."""
    on_path_share: float = 0.0
    """Share of episodes that start between the start configuration and the target."""
    at_target_share: float = 0.0
    """Share of episodes that start at the target."""
    anywhere_share: float = 0.0
    """Shares of targets and of starts drawn from the reachable box, not from the stations."""
    grasp: GraspRules = field(default=REACH_ONLY)
    """Phases of a pick; by default a target counts when it is reached."""
    n_candidates: tuple[int, int] = (1, 1)
    """Fewest and most targets offered per episode, at most ``MAX_CANDIDATES``; a cell needs as
    many stations."""
    people: tuple[HumanKind, ...] | None = None
    """People in the cell, 0 to 4; None for the cell's own."""
    work: HumanMotionConfig = field(default=USUAL)
    """Motion, body dimensions and yielding of the workers."""
    start: StartRule = "clearance"
    """Start of people: ``clearance`` (at least ``start_clearance_m`` from the robot) or
    ``uniform`` (anywhere, even in contact)."""
    action: ActionSettings = field(default=DEFAULT_ACTION)
    """Action type (docs/method.md 2.2)."""
    observation: Literal["features", "state", "body", "phase", "two-people"] = "features"
    """Contents of observations, a key of ``VIEWS``."""
    weights: RewardWeights = field(default=DEFAULT_WEIGHTS)
    """Reward coefficients (docs/method.md 3.3)."""

    def __post_init__(self) -> None:
        choices = (("start", get_args(StartRule)), ("observation", tuple(VIEWS)))
        for name, known in choices:
            if (rule := getattr(self, name)) not in known:
                raise InvalidInput(name, rule, "must be one of the choices", known)
        for name in ("time_limit_s", "short_limit_s"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise InvalidInput(name, getattr(self, name), "must be positive and finite")
        for name in ("short_share", "on_path_share", "at_target_share", "anywhere_share"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise InvalidInput(name, getattr(self, name), "must lie in [0, 1]")
        if not math.isfinite(self.start_clearance_m):
            raise InvalidInput("start_clearance_m", self.start_clearance_m, "must be finite")
        if not 0.0 <= self.target_jitter_m < math.inf:
            rule = "must be finite and not negative"
            raise InvalidInput("target_jitter_m", self.target_jitter_m, rule)
        _check_grasp(self.grasp)
        fewest, most = self.n_candidates
        if not 1 <= fewest <= most <= MAX_CANDIDATES:
            rule = f"must be a least and a greatest number in [1, {MAX_CANDIDATES}]"
            raise InvalidInput("n_candidates", list(self.n_candidates), rule)


def _check_grasp(grasp: GraspRules) -> None:
    """Raise InvalidInput unless the descent has a length and closing takes time."""
    if not 0.0 <= grasp.depth < math.inf:
        raise InvalidInput("grasp.depth", grasp.depth, "must be finite and not negative")
    if not 0.0 < grasp.close_s < math.inf:
        raise InvalidInput("grasp.close_s", grasp.close_s, "must be positive and finite")


WHOLE_PICK = PickSettings(time_limit_s=12.0, grasp=GraspRules(), observation="two-people")
"""Approach, grasp and lift, observed with the phase and two people."""


def _world_of(cell: Cell, settings: PickSettings) -> starts.PickCell:
    if (lack := lacks_for_pick_episodes(cell)) is not None:
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
    return starts.PickCell(
        stations=positions,
        station_q=postures,
        n_cubes=len(cell.stations_of("cube")),
        arm=arm,
        people=people_of(cell, settings.work),
    )


def _rules_of(settings: PickSettings, stations: Vec) -> starts.PickRules:
    """Return the rules of episodes; candidates are different stations.

    Raises:
        InvalidInput: Episodes offer more candidates than there are stations.
    """
    if settings.n_candidates[1] > len(stations):
        rule = f"must be at most {len(stations)}, as many as the cell has cubes and docks"
        raise InvalidInput("n_candidates", list(settings.n_candidates), rule)
    box = np.stack([stations.min(axis=0), stations.max(axis=0)])
    box += np.outer((-1.0, 1.0), BOX_MARGIN)
    return starts.PickRules(
        time_limit=settings.time_limit_s,
        short_limit=settings.short_limit_s,
        short_share=settings.short_share,
        start_clearance=settings.start_clearance_m if settings.start == "clearance" else -FAR,
        target_jitter=settings.target_jitter_m,
        on_path_share=settings.on_path_share,
        at_target_share=settings.at_target_share,
        anywhere_share=settings.anywhere_share,
        box=box,
        n_candidates_min=settings.n_candidates[0],
        n_candidates_max=settings.n_candidates[1],
    )


class PickBatch(EnvBatch):
    """Many independent pick environments, stepped together by one thread.

    Args:
        seed: Seed; episode ``k`` of environment ``e`` is determined by (seed, e, k).
        settings: Settings of the scenario.
        first_env: Number of the first environment: environments of a batch that starts at ``k``
            equal environments ``k`` and on of a batch that starts at 0, bit for bit.

    Raises:
        InvalidInput: The cell lacks stations for picking or for the number of candidates.
    """

    STATE: ClassVar[tuple[str, ...]] = (*EnvBatch.STATE, "_observation_work")
    _kernel = episode
    world: starts.PickCell

    def __init__(
        self, cell: Cell, n_envs: int, seed: int, settings: PickSettings, first_env: int = 0
    ) -> None:
        self.cell = cell if settings.people is None else with_people(cell, settings.people)
        self.settings, world = settings, _world_of(self.cell, settings)
        super().__init__(
            world,
            starts.PickTask(
                _rules_of(settings, world.stations),
                settings.grasp,
                settings.action.rule(),
                settings.weights,
            ),
            new_people_state(self.cell, world.people, n_envs),
            n_envs=n_envs,
            n_act=CONTROLLED,
            seed=seed,
            first_env=first_env,
            view=VIEWS[settings.observation],
        )
        self._observation_work = observation_workspace_of(self.cell)

    def _observe(self, envs: Indices, out: NDArray[np.float32]) -> None:
        shared = self.world, self.settings.grasp, self.state
        work = self._work, self._observation_work
        self._call(episode.observe_envs, *shared, envs, *work, self._view, out)

    def set_collision_cost(self, cost: float) -> None:
        """Set the cost of a collision in rewards from now on."""
        self._task = self._task._replace(weights=self._task.weights._replace(c_c=cost))

    def set_goals(self, envs: Indices, goals: Vec) -> None:
        """Set new targets [m], shape (len(envs), 3), in some environments.

        Raises:
            InvalidInput: An environment does not exist, or the targets have another shape.
            SimulationError: A number is NaN or infinite.
        """
        shared, checked = (self.world, self.settings.grasp, self.state), self._checked(envs)
        for e, goal in zip(checked, self._checked_goals(checked, goals), strict=True):
            starts.set_goal(*shared, int(e), goal, self._work.robot)

    def shorten(self, envs: Indices, shares: Vec) -> None:
        """Leave a share of the time left, in whole control periods; observe again.

        Args:
            envs: Environments.
            shares: Shares in [0, 1], shape (len(envs),); rounded up to a control period.
        """
        left, dt, checked = self.state.time_left, self.arm.dt, self._checked(envs)
        left[checked] = np.ceil(shares * left[checked] / dt) * dt
        self._look(checked)

    def set_starts(self, q: Vec) -> None:
        """Place the robots at rest in given configurations [rad], shape (n_envs, 6)."""
        require_shape("q", q, self.state.q.shape)
        require_finite("q", q)
        shared = self.world, self.settings.grasp, self.state
        self.state.q[:], self.state.qd[:], self.state.qdd[:] = q, 0.0, 0.0
        starts.measure_starts(*shared, self._work)


def observation_workspace_of(cell: Cell) -> PickObservationWorkspace:
    """Return work space for observations in a cell, one at a time."""
    far = human.rest_posture(*FAR_AWAY)
    size, predictor = as_kernel_array(cell.body), new_worker_predictor()
    tool = cell.robot.tool_length, cell.robot.tool_radius
    return new_pick_observation_workspace(cell.floor_z, far, size, predictor, tool)


def target_configurations(arm: Arm, grasp: GraspRules, goals: Vec) -> tuple[Vec, Vec, Flags]:
    """Return the vertical-tool configurations at n targets and at their objects.

    Args:
        arm: From :func:`~app.sim.scene.scene.arm_of`.
        grasp: Phases of a pick.
        goals: Targets [m], shape (n, 3).

    Returns:
        Configurations at the targets and at the objects [rad], shape (n, 6) each, and whether
        both are reachable, (n,).
    """
    low = goals - (0.0, 0.0, grasp.depth)
    q_goals, over = kinematics.ik_vertical_batch(arm.lengths, arm.limits, goals)
    q_grasps, at = kinematics.ik_vertical_batch(arm.lengths, arm.limits, low)
    return q_goals, q_grasps, over & at


def queries(
    grasp: GraspRules,
    robot: tuple[Vec, Vec],
    people: tuple[Vec, Vec, Vec],
    targets: tuple[Vec, Vec, Vec],
    progress: tuple[Indices, Vec],
) -> PickQuery:
    """Return n states as queries; the target of a state depends on its phase.

    Args:
        grasp: Phases of a pick.
        robot: Joint positions [rad] and speeds [rad/s], shape (n, 6) each.
        people: Joint positions [m, rad] and speeds [m/s, rad/s], shape (n, P, 18) each, and
            body dimensions [m], shape (n, P, body.N_SIZE).
        targets: Targets [m], shape (n, 3), and the configurations at them and at their objects
            [rad], shape (n, 6) each.
        progress: Phase of the pick and closing time [s], shape (n,) each.
    """
    (goals, q_goals, q_grasps), (phase, closing) = targets, progress
    low = phase == DESCEND
    points = goals - np.outer(low, (0.0, 0.0, grasp.depth))
    wanted = np.where(low[:, None], q_grasps, q_goals)
    human_q, human_qd, size = people
    share = closing / grasp.close_s
    return PickQuery(*robot, human_q, human_qd, size, points, wanted, q_grasps, phase, share)


def step_robot(
    arm: Arm, q: Vec, qd: Vec, qdd: Vec, act: Vec, action: ActionSettings = DEFAULT_ACTION
) -> TrajectorySegment:
    """Move the robot through one control period.

    Args:
        arm: From :func:`~app.sim.scene.scene.arm_of`.
        q: Joint positions [rad], shape (6,).
        qd: Joint speeds [rad/s], shape (6,).
        qdd: Joint accelerations [rad/s^2], shape (6,); only degree 3 reads them.
        act: Action in [-1, 1], shape (5,).
        action: Action type.

    Raises:
        SimulationError: A number is NaN or infinite.
    """
    require_finite("q, qd, qdd, act", np.concatenate([q, qd, qdd, act]))
    segment = actions.Coefficients(np.empty(6), np.empty(6))
    end = JointState(np.empty(6), np.empty(6), np.empty(6))
    start = JointState(as_kernel_array(q), as_kernel_array(qd), as_kernel_array(qdd))
    commanded = np.array(act, dtype=np.float32)
    actions.advance(action.rule(), arm.limits, arm.dt, start, commanded, segment, end)
    return TrajectorySegment(c=segment.c, d=segment.d, q=end.q, qd=end.qd, qdd=end.qdd)


def tool_state(arm: Arm, q: Vec, qd: Vec, goal: Vec) -> tuple[float, float, float, bool]:
    """Return distance to a target [m], tilt [rad], tcp speed [m/s] and whether it is a success.

    Args:
        arm: From ``scene.arm_of``.
        q: Joint positions [rad], shape (6,).
        qd: Joint speeds [rad/s], shape (6,).
        goal: Target of the tcp [m], shape (3,).
    """
    pose = arm_kernel.new_robot_pose(arm)
    arm_kernel.place_robot(arm, as_kernel_array(q), pose)
    distance, tilt = distance_to(as_kernel_array(goal), pose), arm_kernel.robot_tilt(pose)
    speed = arm_kernel.tcp_speed(pose, as_kernel_array(qd))
    return distance, tilt, speed, bool(episode.succeeded(distance, tilt, speed))
