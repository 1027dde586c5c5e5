"""The reach scenario of thesis chapter 4: a robot reaches goals beside people who walk about.

:class:`ReachBatch` steps many environments in compiled kernels (``reach/kernels/episode.py``).
Source: docs/method.md 2.1 to 2.3.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from app.errors import InvalidInput
from app.sim.cells.cell import Cell
from app.sim.cells.parts import GoalRegion, Station
from app.sim.cells.people import Worker
from app.sim.core.arrays import Vec, as_kernel_array
from app.sim.core.jit import FAR
from app.sim.people.human_motion_config import REACHING, HumanMotionConfig
from app.sim.people.kernels.people import People
from app.sim.people.pedestrian import AUTHORS_WALK, pedestrian_rules
from app.sim.prediction.weights import new_motion_predictor
from app.sim.reach.goal_sets import N_HALTON, halton_targets
from app.sim.reach.kernels import episode, queries
from app.sim.reach.kernels.observation import ALL_PEOPLE, N_FEATURES, N_STATE
from app.sim.reach.kernels.observation_workspace import new_observation_workspace
from app.sim.reach.kernels.option_features import N_OPTION_FEATURES
from app.sim.reach.kernels.people_set import N_PEOPLE_SET
from app.sim.reach.kernels.reward import ReachWeights
from app.sim.reach.recipe_rules import BlockedRules, with_authors_limits
from app.sim.robot.actions import ActionSettings
from app.sim.scenario.batch import EnvBatch
from app.sim.scenario.kernels.episode import FEATURES, FORECAST, PEOPLE_SET, PLAIN, Indices
from app.sim.scene.scene import (
    HumanKind,
    arm_of,
    kinds_of,
    new_people_state,
    pedestrian_settings,
    people_of,
    require_shape,
    with_people,
)

N_ACT = 6
"""Joints that a policy moves: all."""
StartRule = Literal["clearance", "uniform", "authors"]
GoalRule = Literal["grid", "in-turn", "halton", "box"]
LimitRule = Literal["cell", "authors"]
ViewName = Literal["features", "state", "forecast", "people-set"]
VIEWS = {
    "state": (PLAIN, N_STATE),
    "features": (FEATURES, N_FEATURES),
    "forecast": (FORECAST, N_FEATURES + N_OPTION_FEATURES),
    "people-set": (PEOPLE_SET, N_FEATURES + N_OPTION_FEATURES + N_PEOPLE_SET),
}
"""Contents and lengths of observations: the raw state (4.30); the raw state and features; those
and the option features beside people who move as predicted; all that and the people as a
set."""
THESIS_WEIGHTS = ReachWeights(
    c_d=1.0, c_p=0.0, gamma=1.0, c_a=0.1, c_step=0.0, c_c=5.0, c_s=20.0
)
"""Coefficients of the thesis (docs/method.md 2.3)."""
DEFAULT_ACTION = ActionSettings()


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachSettings:
    """Settings of the reach scenario.

    Raises:
        InvalidInput: A rule is unknown, or a number is out of range.
    """

    time_limit_s: float = 5.0
    """Longest episode [s]."""
    goals: GoalRule = "grid"
    """Goals: the grid points of the cell's goal region (drawn, or in turn), the points of a
    Halton set in it, or uniform in it."""
    n_halton: int = N_HALTON
    """Number of points of the Halton set."""
    people: tuple[HumanKind, ...] | None = None
    """People in the cell, 0 to 4; None for the cell's own. A cell without workers gets a
    workplace at the table (:func:`with_workplace`)."""
    start: StartRule = "clearance"
    """Start of people: ``clearance`` (at least ``start_clearance_m`` from the robot),
    ``uniform`` (anywhere, even in contact), or ``authors`` (anywhere, and walking as in the
    authors' code: targets at least 0.5 m away and a radius inside the area, first cycle not
    slower than v_min, probability 0.01 per cycle of leaving a target)."""
    start_clearance_m: float = 0.05
    """Least clearance of robot and people at the start under the rule ``clearance`` [m]."""
    collision_ends: bool = True
    """Whether a collision ends the episode. If not, the episode continues until success or
    timeout and then counts as a collision."""
    limits: LimitRule = "cell"
    """Limits of the joints: the cell's, or those of the authors (``recipe_rules.py``)."""
    blocked: BlockedRules | None = None
    """Reward where a contact blocks the arm, for ``new_reach_batch``; None: it does not."""
    work: HumanMotionConfig = field(default=REACHING)
    """Motion, body dimensions and yielding of the workers."""
    action: ActionSettings = field(default=DEFAULT_ACTION)
    """Action type (docs/method.md 2.2)."""
    observation: ViewName = "features"
    """Observation; see VIEWS."""
    weights: ReachWeights = field(default=THESIS_WEIGHTS)
    """Reward coefficients (docs/method.md 2.3)."""

    def __post_init__(self) -> None:
        choices = (
            ("goals", GoalRule),
            ("start", StartRule),
            ("observation", ViewName),
            ("limits", LimitRule),
        )
        for name, known in choices:
            value = getattr(self, name)
            if value not in get_args(known):
                raise InvalidInput(name, value, "must be one of the choices", get_args(known))
        if not (math.isfinite(self.time_limit_s) and self.time_limit_s > 0.0):
            raise InvalidInput("time_limit_s", self.time_limit_s, "must be positive")
        if not math.isfinite(self.start_clearance_m):
            raise InvalidInput("start_clearance_m", self.start_clearance_m, "must be finite")


def stated_rules(cell: Cell, settings: ReachSettings) -> dict[str, Any]:
    """Return the rules that affect results, to be reported with every number."""
    chosen = _cell_of(cell, settings)
    stated: dict[str, Any] = {
        "cell": cell.name,
        "people": list(kinds_of(chosen)),
        "start": settings.start,
        "collision_ends": settings.collision_ends,
        "goals": settings.goals,
        "time_limit_s": settings.time_limit_s,
    }
    if settings.limits != "cell":
        stated |= {"limits": settings.limits, "blocked": settings.blocked is not None}
    if settings.goals == "halton":
        stated["n_halton"] = settings.n_halton
    if settings.start == "clearance":
        stated["start_clearance_m"] = settings.start_clearance_m
    if settings.start == "authors":
        stated["walk"] = dict(AUTHORS_WALK)
    return stated


def with_workplace(cell: Cell) -> Cell:
    """Return a cell with a worker who reaches for its goals.

    The worker stands at the far edge of the table, as far from it as in ``pick-and-place``, and
    follows reach scripts (docs/method.md 3.2) from goals of the lowest layer, except the row
    nearest to the robot, to the two ends of that row.
    """
    targets = goal_region_of(cell).targets()
    lowest = targets[targets[:, 2] == targets[:, 2].min()]
    near = lowest[lowest[:, 1] == lowest[:, 1].min()]
    far = lowest[lowest[:, 1] > lowest[:, 1].min()]
    edge, aside = cell.table.y_max + 0.17, 0.7
    worker = Worker(
        home=(0.0, edge + 0.33, -0.5 * math.pi),
        x_min=-aside,
        x_max=aside,
        y_min=edge,
        y_max=edge + 0.58,
        pelvis_height=0.95,
    )
    places = [("cube", point) for point in far] + [("dock", point) for point in near[[0, -1]]]
    stations = tuple(
        Station(
            id=f"goal{number}",
            kind="cube" if kind == "cube" else "dock",
            label=f"Goal {number}",
            position=(float(point[0]), float(point[1]), float(point[2])),
        )
        for number, (kind, point) in enumerate(places)
    )
    return cell.model_copy(update={"people": (*cell.people, worker), "stations": stations})


def _cell_of(cell: Cell, settings: ReachSettings) -> Cell:
    if settings.limits == "authors":
        cell = with_authors_limits(cell)
    if settings.people is None:
        return cell
    if "worker" in settings.people and not cell.workers:
        cell = with_workplace(cell)
    return with_people(cell, settings.people)


def goal_region_of(cell: Cell) -> GoalRegion:
    """Return the goal region of a cell.

    Raises:
        InvalidInput: The cell has no goal region.
    """
    if cell.goal_region is None:
        raise InvalidInput("cell", cell.name, "cannot be used for reaching: no goal_region")
    return cell.goal_region


def targets_of(region: GoalRegion, settings: ReachSettings) -> Vec:
    """Return the numbered goals of a region [m], shape (n, 3); the grid's for the rule ``box``.

    Raises:
        InvalidInput: A Halton set has too few or too many points, or its box no volume.
    """
    if settings.goals == "halton":
        return halton_targets(region, settings.n_halton)
    return region.targets()


def _people_of(cell: Cell, settings: ReachSettings) -> People:
    people = people_of(cell, settings.work)
    if settings.start != "authors":
        return people
    walkers = [
        replace(pedestrian_settings(person), **AUTHORS_WALK) for person in cell.cylinders
    ]
    return people._replace(walkers=pedestrian_rules(walkers))


def reach_cell_of(cell: Cell, people: People, targets: Vec) -> episode.ReachCell:
    """Return the data of a cell for the kernels.

    Args:
        cell: Work cell with a goal region.
        people: From :func:`~app.sim.scene.scene.people_of`.
        targets: Goals to draw from [m], shape (n, 3).
    """
    low, high = goal_region_of(cell).box()
    return episode.ReachCell(
        targets=as_kernel_array(targets),
        low=low,
        high=high,
        arm=arm_of(cell),
        people=people,
    )


def _rules_of(settings: ReachSettings) -> episode.ReachRules:
    return episode.ReachRules(
        time_limit=settings.time_limit_s,
        start_clearance=settings.start_clearance_m if settings.start == "clearance" else -FAR,
        anywhere=settings.goals == "box",
        collision_ends=settings.collision_ends,
    )


class ReachBatch(EnvBatch):
    """Many independent reach environments, stepped together by one thread.

    Args:
        cell: Work cell with a goal region.
        seed: Seed; episode ``k`` of environment ``e`` is determined by (seed, e, k).
        settings: Settings of the scenario.
        first_env: Number of the first environment: environments of a batch that starts at ``k``
            equal environments ``k`` and on of a batch that starts at 0, bit for bit.
    """

    STATE: ClassVar[tuple[str, ...]] = (*EnvBatch.STATE, "_observation_work")
    _kernel = episode
    world: episode.ReachCell

    def __init__(
        self, cell: Cell, n_envs: int, seed: int, settings: ReachSettings, first_env: int = 0
    ) -> None:
        self.cell, self.settings = _cell_of(cell, settings), settings
        targets = targets_of(goal_region_of(self.cell), settings)
        world = reach_cell_of(self.cell, _people_of(self.cell, settings), targets)
        people = new_people_state(self.cell, world.people, n_envs)
        super().__init__(
            world,
            episode.ReachTask(_rules_of(settings), settings.action.rule(), settings.weights),
            people,
            n_envs=n_envs,
            n_act=N_ACT,
            seed=seed,
            first_env=first_env,
            view=VIEWS[settings.observation],
        )
        self._observation_work = new_observation_workspace(
            self.arm, world.people, people, new_motion_predictor()
        )

    def _start(self, envs: Indices) -> None:
        """Start episodes in some environments, with the next goals where they are in turn."""
        super()._start(envs)
        if self.settings.goals == "in-turn":
            robot, targets = self._work.robot, self.world.targets
            numbers = (self._first + envs + self.state.episode[envs]) % len(targets)
            for e, number in zip(envs.tolist(), numbers.tolist(), strict=True):
                episode.set_goal(self.world, self.state, e, targets[number], robot)
                self.state.target[e] = number

    def set_goals(self, envs: Indices, goals: Vec) -> NDArray[np.float32]:
        """Set other goals in some environments, until their episodes end.

        Args:
            envs: Numbers of the environments, shape (n,).
            goals: Goals of the tcp [m], shape (n, 3).

        Returns:
            Observations of all environments, (n_envs, obs_size).

        Raises:
            InvalidInput: An environment does not exist, or the goals have another shape.
            SimulationError: A number is NaN or infinite.
        """
        checked = self._checked(envs)
        for e, goal in zip(checked, self._checked_goals(checked, goals), strict=True):
            episode.set_goal(self.world, self.state, int(e), goal, self._work.robot)
        return self._look(checked)

    def observe_goals(
        self, envs: Indices, goals: Vec, person: int | None = None
    ) -> NDArray[np.float32]:
        """Return the observations of some environments with other goals.

        Args:
            envs: Numbers of the environments, shape (k,).
            goals: Goals of the tcp [m], shape (k, n, 3).
            person: The only person that is present, workers first; None for all people.

        Returns:
            Observations, (k, n, obs_size); with the environment's own goal and all people they
            equal the ordinary observation bit for bit.

        Raises:
            InvalidInput: An environment or person does not exist, or the goals have another
                shape.
        """
        shape = (len(envs), np.shape(goals)[1] if np.ndim(goals) == 3 else 0, 3)
        require_shape("goals", np.asarray(goals), shape)
        out = np.empty((*shape[:2], self.obs_size), dtype=np.float32)
        if person is not None and not 0 <= person < self.n_people:
            raise InvalidInput("person", person, f"must be one of {self.n_people} people")
        which = ALL_PEOPLE if person is None else person
        self._write(self._checked(envs), which, as_kernel_array(goals), out)
        return out

    def _observe(self, envs: Indices, out: NDArray[np.float32]) -> None:
        self._write(envs, ALL_PEOPLE, self.state.goal[envs][:, None], out[:, None])

    def _write(self, envs: Indices, which: int, goals: Vec, out: NDArray[np.float32]) -> None:
        """Write the observations for some goals, shape (k, n, obs_size)."""
        state = self.world, self.state, envs, self._observation_work
        self._call(queries.observe_envs, *state, self._view, which, goals, out)

    def person_distances(self, envs: Indices) -> Vec:
        """Return the distance of the robot to each person in some environments.

        Args:
            envs: Numbers of the environments, shape (k,).

        Returns:
            Distances [m], shape (k, n_people).

        Raises:
            InvalidInput: An environment does not exist.
        """
        out = np.empty((len(envs), self.n_people))
        checked = self._checked(envs)
        queries.distances_of_envs(self.world, self.state, checked, self._observation_work, out)
        return out

    @property
    def n_people(self) -> int:
        """Number of people in each environment; workers come first."""
        return len(self.cell.people)

    def observe(self) -> NDArray[np.float32]:
        """Update all clearances and observations after the state was changed from outside."""
        queries.measure_envs(self.world, self.state, self._all, self._observation_work)
        return self._look(self._all)
