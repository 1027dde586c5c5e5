"""One state that a client sends, observed as the reach scenario's policies observe it.

:class:`QueryState` holds one environment of the scenario (``batch.py``) with a given number of
people of each kind. The same kernels observe it as in training.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.sim.cells.cell import Cell
from app.sim.collision.checker import Shapes, greatest_speeds
from app.sim.core.arrays import Vec
from app.sim.core.jit import direct
from app.sim.human.person import Person
from app.sim.people.kernels.pedestrian import (
    GROWTH,
    N_PAST,
    PAST_RADIUS,
    PAST_SPEED,
    VX,
    VY,
    R,
    X,
    Y,
    remember_as_now,
)
from app.sim.prediction.weights import new_motion_predictor
from app.sim.reach.batch import VIEWS, ViewName, reach_cell_of, with_workplace
from app.sim.reach.kernels import queries
from app.sim.reach.kernels.observation import ALL_PEOPLE
from app.sim.reach.kernels.observation_workspace import new_observation_workspace
from app.sim.reach.kernels.query_state import load_state
from app.sim.robot.measured_state import Joints
from app.sim.scenario.kernels.episode import new_episode_state
from app.sim.scene.scene import HumanKind, new_people_state, people_of, with_people

_ROW = np.zeros(1, dtype=np.int64)


class QueryState:
    """One state with a number of workers and pedestrians; not thread-safe.

    Args:
        cell: Work cell with a goal region.
        n_bodies: Number of people given by joint angles; they come first.
        n_cylinders: Number of people given as cylinders.
        view: Observation of the policy.
    """

    def __init__(self, cell: Cell, n_bodies: int, n_cylinders: int, view: ViewName) -> None:
        people: list[HumanKind] = ["worker"] * n_bodies
        people += ["walker"] * n_cylinders
        populated = with_people(with_workplace(cell) if n_bodies else cell, people)
        shared = people_of(populated)
        self.world = reach_cell_of(populated, shared, np.zeros((0, 3)))
        rows = new_people_state(populated, shared, 1)
        self.state = new_episode_state(self.world.arm, rows, 1)
        self._work = new_observation_workspace(
            self.world.arm, shared, rows, new_motion_predictor()
        )
        self._view, self.obs_size = VIEWS[view]
        self.arm, self.top_z = self.world.arm, shared.top_z
        self._own_size = shared.bodies[0]
        self._measured = np.ones(n_cylinders, dtype=np.bool_)
        self._tops = np.full((n_cylinders, 1), self.top_z)
        self.distances = np.zeros(n_bodies + n_cylinders)
        """Distance of the robot to each person [m], bodies first, shape (n_people,)."""
        self._speeds = np.zeros(self._work.geometry.capsules.shape[1])
        self._call: Callable[..., None] | None = None
        self._buffers: dict[int, tuple[Vec, NDArray[np.float32]]] = {}
        self._load = direct(load_state, self._shared)

    @property
    def _shared(self) -> tuple[Any, ...]:
        return self.world, self.state, self._work, self.distances, self._speeds

    @property
    def clear(self) -> Vec:
        """Clearances to people, cell and the robot itself [m], shape (3,)."""
        clear: Vec = self.state.clear[0]
        return clear

    @property
    def tcp(self) -> Vec:
        """Tool centre point [m], shape (3,)."""
        return self._work.robot.tcp

    @property
    def observed(self) -> Vec:
        """The person observed last: x, y [m], vx, vy [m/s], r [m], growth [m/s], shape (6,)."""
        return self._work.observed

    @property
    def shapes(self) -> Shapes:
        """The people as shapes, bodies first."""
        geometry = self._work.geometry
        going = self.state.people.walkers.rows[0][:, [VX, VY, GROWTH]]
        return Shapes(
            capsules=geometry.capsules.copy(),
            cylinders=np.concatenate([geometry.cylinders, self._tops], axis=1),
            going=np.where(self._measured[:, None], going, np.nan),
            speed=self._speeds.copy(),
            cylinder_speed=greatest_speeds(going),
        )

    def load(self, robot: Joints, people: Sequence[Person], time_left_s: float) -> None:
        """Load a state and compute its clearances.

        Args:
            robot: Positions, speeds and accelerations of its joints.
            people: Checked people, those with joint angles first, then cylinders.
            time_left_s: Time left to reach the goal [s].
        """
        state = self.state
        state.q[0], state.qd[0], state.qdd[0] = robot
        state.time_left[0] = time_left_s
        rows, first = state.people, state.people.q.shape[1]
        for i, person in enumerate(people):
            if person.cylinder is None:
                rows.q[0, i], rows.qd[0, i] = person.q, person.qd
                rows.size[0, i] = self._own_size if person.size is None else person.size
                continue
            walker = rows.walkers.rows[0, i - first]
            self._measured[i - first] = person.measured
            self._tops[i - first] = max(self.top_z, person.top)
            walker[X], walker[Y], walker[R] = person.cylinder
            walker[VX], walker[VY], walker[GROWTH] = *person.qd[:2], person.growth
            remember_as_now(rows.walkers.rows, 0, i - first)
            if person.past is not None:
                _load_past(walker, person.past)
            rows.cylinders[0, i - first] = person.cylinder
        self._load(*self._shared)

    def observe(self, goals: Vec, person: int | None = None) -> NDArray[np.float32]:
        """Return the observations of the state for some goals.

        Args:
            goals: Goals of the tcp [m], shape (n, 3).
            person: The only person that is present, bodies first; None for all people.

        Returns:
            Observations, shape (n, obs_size); overwritten by the next call.
        """
        n = len(goals)
        if n not in self._buffers:
            shape = (1, n, self.obs_size)
            self._buffers[n] = (np.zeros((1, n, 3)), np.zeros(shape, dtype=np.float32))
        places, out = self._buffers[n]
        places[0] = goals
        arguments = (
            self.world,
            self.state,
            _ROW,
            self._work,
            self._view,
            ALL_PEOPLE if person is None else person,
            places,
            out,
        )
        if self._call is None:
            self._call = direct(queries.observe_envs, arguments)
        self._call(*arguments)
        found: NDArray[np.float32] = out[0]
        return found


def _load_past(walker: Vec, past: Vec) -> None:
    """Set the remembered radii and speeds of a pedestrian; older ones repeat the oldest.

    Args:
        walker: State of the pedestrian, shape (N_STATE,); its past equals the present.
        past: As in ``Person.past``.
    """
    known = np.concatenate([[[walker[PAST_RADIUS], walker[PAST_SPEED]]], past])
    held = np.minimum(np.arange(N_PAST), len(known) - 1)
    walker[PAST_RADIUS : PAST_RADIUS + N_PAST] = known[held, 0]
    walker[PAST_SPEED : PAST_SPEED + N_PAST] = known[held, 1]
