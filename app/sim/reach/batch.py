"""The reach scenario of thesis chapter 4: a robot reaches goals beside people who walk about.

:class:`ReachBatch` steps many cells at once in compiled kernels (``reach/kernels/episode.py``).
Source: METHOD 2.1 to 2.3.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from app.errors import InvalidInput
from app.sim.cells.cell import Cell
from app.sim.cells.parts import GoalRegion, Station
from app.sim.cells.people import Worker
from app.sim.core.arrays import Vec, as_kernel_array, as_kernel_index
from app.sim.geometry.segments import FAR
from app.sim.people.human_motion_config import REACHING, HumanMotionConfig
from app.sim.people.kernels.people import People, PeopleState
from app.sim.people.pedestrian import AUTHORS_WALK, pedestrian_rules
from app.sim.prediction.weights import new_motion_predictor
from app.sim.reach.goal_sets import N_HALTON, halton_targets
from app.sim.reach.kernels import episode as reach
from app.sim.reach.kernels import queries as reach_views
from app.sim.reach.kernels.observation import EVERYBODY, N_FEATURES, N_STATE
from app.sim.reach.kernels.option_features import N_OPTION_FEATURES
from app.sim.reach.kernels.people_set import N_CROWD
from app.sim.reach.kernels.reward import ReachWeights
from app.sim.robot.actions import ActionSettings
from app.sim.scenario.batch import EnvBatch, Rows
from app.sim.scenario.kernels.episode import CROWD, FEATURES, FORECAST, PLAIN
from app.sim.scene.scene import (
    HumanKind,
    arm_of,
    kinds_of,
    new_people_state,
    pedestrian_settings,
    people_of,
    require_finite,
    require_shape,
    with_people,
)

N_ACT = 6
"""Joints a policy moves: all of them."""
StartRule = Literal["clearance", "uniform", "authors"]
GoalRule = Literal["grid", "halton", "box"]
ViewName = Literal["features", "state", "forecast", "crowd"]
VIEWS = {
    "state": (PLAIN, N_STATE),
    "features": (FEATURES, N_FEATURES),
    "forecast": (FORECAST, N_FEATURES + N_OPTION_FEATURES),
    "crowd": (CROWD, N_FEATURES + N_OPTION_FEATURES + N_CROWD),
}
"""What observations hold: the plain state (4.30), that and features, those and what comes of
every way beside people who go on as forecast, or all that and everybody as a set; and their
lengths."""
THESIS_WEIGHTS = ReachWeights(
    c_d=1.0, c_p=0.0, gamma=1.0, c_a=0.1, c_step=0.0, c_c=5.0, c_s=20.0
)
"""The source's coefficients (METHOD 2.3)."""
PROGRESS_WEIGHTS = ReachWeights(
    c_d=0.0, c_p=1.0, gamma=1.0, c_a=0.0, c_step=0.004, c_c=4.0, c_s=4.0
)
"""Progress instead of distance: learned to 95 % within minutes in trials."""
DEFAULT_ACTION = ActionSettings()


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachSettings:
    """How episodes of the scenario start and end.

    Raises:
        InvalidInput: An unknown rule, or a time that is not positive and finite.
    """

    time_limit_s: float = 5.0
    """Longest episode [s]."""
    goals: GoalRule = "grid"
    """Where goals are drawn from: the grid points of the cell's goal region, the points of a
    Halton set in it, or all of it."""
    n_halton: int = N_HALTON
    """Points of the Halton set; read where ``goals`` is ``halton``."""
    people: tuple[HumanKind, ...] | None = None
    """Who is in the cell, 0 to 4 people; None for the cell's own. A worker whom the cell does
    not describe stands at the table (:func:`with_workplace`)."""
    start: StartRule = "clearance"
    """Where people may start: ``clearance`` (``start_clearance_m`` from the robot), ``uniform``
    (anywhere, even in contact), ``authors`` (anywhere, and they walk as in the authors' code:
    targets at least 0.5 m away and a radius inside the area, the first period never slower than
    v_min, a chance of 0.01 per period to walk on after having stayed at a target)."""
    start_clearance_m: float = 0.05
    """Least distance of robot and people at the start under the rule ``clearance`` [m]."""
    collision_ends: bool = True
    """Whether a collision ends the episode. If not, it goes on until the goal is reached or
    time is up, and then counts as a collision, not as a success."""
    work: HumanMotionConfig = field(default=REACHING)
    """What the workers do: their motion, sizes and yielding."""
    action: ActionSettings = field(default=DEFAULT_ACTION)
    """What actions mean (METHOD 2.2)."""
    observation: ViewName = "features"
    """What policies see: the plain state (4.30), or that and more; see VIEWS."""
    weights: ReachWeights = field(default=THESIS_WEIGHTS)
    """Reward coefficients (METHOD 2.3)."""

    def __post_init__(self) -> None:
        choices = (("goals", GoalRule), ("start", StartRule), ("observation", ViewName))
        for name, known in choices:
            value = getattr(self, name)
            if value not in get_args(known):
                raise InvalidInput(name, value, "must name a rule", get_args(known))
        if not (math.isfinite(self.time_limit_s) and self.time_limit_s > 0.0):
            raise InvalidInput("time_limit_s", self.time_limit_s, "must be positive")
        if not math.isfinite(self.start_clearance_m):
            raise InvalidInput("start_clearance_m", self.start_clearance_m, "must be finite")


def stated_rules(cell: Cell, settings: ReachSettings) -> dict[str, Any]:
    """Return the rules that move results by points, to be printed with every number.

    Args:
        cell: Work cell.
        settings: Starts and ends.
    """
    chosen = _with_people(cell, settings)
    stated: dict[str, Any] = {
        "cell": cell.name,
        "people": list(kinds_of(chosen)),
        "start": settings.start,
        "collision_ends": settings.collision_ends,
        "goals": settings.goals,
        "time_limit_s": settings.time_limit_s,
    }
    if settings.goals == "halton":
        stated["n_halton"] = settings.n_halton
    if settings.start == "clearance":
        stated["start_clearance_m"] = settings.start_clearance_m
    if settings.start == "authors":
        stated["walk"] = dict(AUTHORS_WALK)
    return stated


def with_workplace(cell: Cell) -> Cell:
    """Return a cell with a worker who reaches for its goals, where it describes none.

    The worker stands at the far edge of the table, as far from it as in ``pick-and-place``, and
    goes by the work cycle of METHOD 3.2: from goals of the lowest layer, except the row nearest
    to the robot, to the two ends of that row.
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


def _with_people(cell: Cell, settings: ReachSettings) -> Cell:
    if settings.people is None:
        return cell
    if "worker" in settings.people and not cell.workers:
        cell = with_workplace(cell)
    return with_people(cell, settings.people)


def goal_region_of(cell: Cell) -> GoalRegion:
    """Return where a cell's goals are.

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


def world_of(cell: Cell, people: People, targets: Vec) -> reach.ReachWorld:
    """Return what the kernels know of a cell and its people.

    Args:
        cell: Work cell with a goal region.
        people: From :func:`~app.sim.scene.scene.people_of`.
        targets: Goals that episodes draw from [m], shape (n, 3).
    """
    region = goal_region_of(cell)
    middle, half = np.array(region.center), 0.5 * np.array(region.size)
    return reach.ReachWorld(
        targets=as_kernel_array(targets),
        low=middle - half,
        high=middle + half,
        arm=arm_of(cell),
        people=people,
    )


def _rules_of(settings: ReachSettings) -> reach.ReachRules:
    return reach.ReachRules(
        time_limit=settings.time_limit_s,
        start_clearance=settings.start_clearance_m if settings.start == "clearance" else -FAR,
        anywhere=settings.goals == "box",
        collision_ends=settings.collision_ends,
    )


def new_state(world: reach.ReachWorld, people: PeopleState, n_envs: int) -> reach.ReachState:
    """Return rows for ``n_envs`` cells, not started yet."""

    def rows(*shape: int) -> Vec:
        return np.zeros((n_envs, *shape))

    def counts() -> NDArray[np.int64]:
        return np.zeros(n_envs, dtype=np.int64)

    return reach.ReachState(
        q=rows(6),
        qd=rows(6),
        qdd=rows(6),
        robot=np.repeat(world.arm.columns[None], n_envs, axis=0),
        people=people,
        goal=rows(3),
        target=counts(),
        time_left=rows(),
        elapsed=rows(),
        distance=rows(),
        touched=counts(),
        episode=counts(),
        outcome=counts(),
        clear=rows(3),
        n_redrawn=counts(),
    )


class ReachBatch(EnvBatch):
    """Many independent reach cells, stepped together by one thread.

    Args:
        cell: Work cell with a goal region.
        n_envs: Number of cells.
        seed: Seed; episode ``k`` of cell ``e`` is fixed by (seed, e, k).
        settings: Starts, ends and rewards.
        first_env: Number of the first cell: rows of a batch that starts at ``k`` equal rows
            ``k`` and on of a batch that starts at 0, bit for bit.
    """

    _kernel = reach

    def __init__(
        self, cell: Cell, n_envs: int, seed: int, settings: ReachSettings, first_env: int = 0
    ) -> None:
        self.cell = _with_people(cell, settings)
        targets = targets_of(goal_region_of(self.cell), settings)
        self.settings = settings
        self.world = world_of(self.cell, _people_of(self.cell, settings), targets)
        self.arm = self.world.arm
        people = new_people_state(self.cell, self.world.people, n_envs)
        self.state = new_state(self.world, people, n_envs)
        super().__init__(
            (
                self.world,
                _rules_of(settings),
                settings.action.rule(),
                settings.weights,
                self.state,
                reach.new_work(self.world, self.state, new_motion_predictor()),
            ),
            n_envs=n_envs,
            n_act=N_ACT,
            seed=seed,
            first_env=first_env,
            view=VIEWS[settings.observation],
        )

    def set_goals(self, rows: Rows, goals: Vec) -> NDArray[np.float32]:
        """Send the robots of ``rows`` to other goals, until their episodes end.

        Args:
            rows: Cells, shape (n,).
            goals: Where their tcp shall be [m], shape (n, 3).

        Returns:
            Observations of all cells, (n_envs, obs_size).

        Raises:
            InvalidInput: There is no such cell, or the goals have another shape.
            SimulationError: A number is NaN or infinite.
        """
        require_shape("goals", np.asarray(goals), (len(rows), 3))
        require_finite("goals", np.asarray(goals, dtype=np.float64))
        checked = self._checked(rows)
        for row, goal in zip(checked, goals, strict=True):
            reach.set_goal(
                self.world, self.state, int(row), as_kernel_array(goal), self._work.robot
            )
        return self._look(checked)

    def observe_goals(
        self, rows: Rows, goals: Vec, who: int | None = None
    ) -> NDArray[np.float32]:
        """Return what a policy would observe in some cells if their goals were others.

        Args:
            rows: Cells, shape (k,).
            goals: Where each tcp shall be [m], shape (k, n, 3).
            who: The person who is there alone, workers first; None for all as they are.

        Returns:
            Observations, (k, n, obs_size); equal, bit for bit, to the ordinary one where the
            goal is the cell's own and nobody is left out.

        Raises:
            InvalidInput: There is no such cell or person, or the goals have another shape.
        """
        shape = (len(rows), np.shape(goals)[1] if np.ndim(goals) == 3 else 0, 3)
        require_shape("goals", np.asarray(goals), shape)
        out = np.empty((*shape[:2], self.obs_size), dtype=np.float32)
        if who is not None and not 0 <= who < self.n_people:
            raise InvalidInput("who", who, f"must be one of {self.n_people} people")
        self._see(
            self._checked(rows), EVERYBODY if who is None else who, as_kernel_array(goals), out
        )
        return out

    def _observe(self, rows: Rows, out: NDArray[np.float32]) -> None:
        self._see(rows, EVERYBODY, self.state.goal[rows][:, None], out[:, None])

    def _see(self, rows: Rows, who: int, goals: Vec, out: NDArray[np.float32]) -> None:
        """Write what policies would see for some goals, shape (k, n, obs_size)."""
        self._call(
            reach_views.observe_rows,
            self.world,
            self.state,
            rows,
            self._work,
            self._view,
            who,
            goals,
            out,
        )

    def person_distances(self, rows: Rows) -> Vec:
        """Return the distances of robot and people in some cells [m], shape (k, n_people).

        Args:
            rows: Cells, shape (k,).

        Raises:
            InvalidInput: There is no such cell.
        """
        out = np.empty((len(rows), self.n_people))
        checked = self._checked(rows)
        reach_views.distances_of_rows(self.world, self.state, checked, self._work, out)
        return out

    @property
    def n_people(self) -> int:
        """People in each cell; workers come first."""
        return len(self.cell.people)

    def _checked(self, rows: Rows) -> Rows:
        numbers = as_kernel_index(np.asarray(rows, dtype=np.int64))
        wrong = numbers[(numbers < 0) | (numbers >= self.n_envs)]
        if wrong.size:
            raise InvalidInput("rows", int(wrong[0]), f"must be one of {self.n_envs} cells")
        return numbers

    def observe(self) -> NDArray[np.float32]:
        """Measure distances to people and write all observations anew, (n_envs, obs_size).

        For whoever changes rows from outside.
        """
        reach_views.measure_rows(self.world, self.state, self._all, self._work)
        return self._look(self._all)
