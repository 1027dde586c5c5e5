"""Symbolic states of many sorting tasks that are executed side by side.

A task alternates between two motions: to an object of a near-optimal move, and with that object
to the place of such a move. A grasp fails with the probability of its slot; the draw is
determined by task and attempt, so that all order rules have the same failures.

Source: docs/method.md 1.2, 3.1.
"""

import numpy as np

from app.policies.evaluation.statistics import Index
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.sorting.batch import SortingSettings, apply, batch_in
from app.sim.sorting.near_optimal_moves import NearOptimalMoves, near_optimal_moves
from app.sim.sorting.state import Move, SortingState

N_DRAWS = 200
"""Draws of a task; they repeat after so many attempts."""
NOTHING = -1
"""Position of the held object where none is held."""


class TaskStates:
    """States, targets and counts of n sorting tasks.

    Args:
        n_objects: Objects of each task, all of them in the goal.
        seed: Seed of the starts and of the grasps.
    """

    def __init__(self, cell: Cell, n_tasks: int, n_objects: int, seed: int) -> None:
        settings = SortingSettings(n_objects=n_objects, n_goal=n_objects)
        batch = batch_in(cell, n_tasks, seed, settings)
        batch.reset()
        self.shape = batch.shape
        """Size of the tasks."""
        stations = [*cell.stations_of("clutter"), *cell.stations_of("cluster")]
        points = [station.points()[: self.shape.n_slots] for station in stations]
        self.points: Vec = np.concatenate(points)
        """Points of the tcp at the objects, place by place and level by level [m], (m, 3)."""
        self._first = np.cumsum([0, *(len(one) for one in points[:-1])])
        self._starts = [batch.state_of(e) for e in range(n_tasks)]
        self._first_moves = [near_optimal_moves(state, self.shape) for state in self._starts]
        self._luck = np.random.default_rng(seed).random((n_tasks, N_DRAWS))
        self.begin()

    def begin(self) -> None:
        """Return all tasks to their starts."""
        n = len(self._starts)
        self._states, self._near = list(self._starts), list(self._first_moves)
        self.held: Index = np.full(n, NOTHING)
        """Position from which the held object was picked, or NOTHING, shape (n,)."""
        self.attempts, self.moves, self.options = (
            np.zeros(n, dtype=np.int64) for _ in range(3)
        )
        self.targets: list[Index] = [self._targets(e) for e in range(n)]
        """Indices of the points that each task may go to, the planner's own first."""
        self.places: list[Index] = [self._places(e) for e in range(n)]
        """Index of the point at the place of each target's object; the targets themselves while
        an object is held."""

    def state(self, e: int) -> SortingState:
        """Return the state of a task; a held object counts where it was picked."""
        return self._states[e]

    def _moves(self, e: int) -> list[Move]:
        """Return a move per target of a task."""
        near: NearOptimalMoves = self._near[e]
        if self.held[e] == NOTHING:
            found: dict[int, Move] = {}
            for move in near.moves:
                found.setdefault(move.pick, move)
            return list(found.values())
        return list(near.of(int(self.held[e])).moves)

    def _targets(self, e: int) -> Index:
        if self.held[e] != NOTHING:
            return self._places(e)
        return self._points(e, [move.pick for move in self._moves(e)], top=True)

    def _places(self, e: int) -> Index:
        return self._points(e, [move.place for move in self._moves(e)], top=False)

    def _points(self, e: int, stations: list[int], *, top: bool) -> Index:
        """Return the indices of the points of the top objects at stations, or over them."""
        n_slots, heights = self.shape.n_slots, self._states[e].heights
        levels = [0 if one < n_slots else int(heights[one - n_slots]) - top for one in stations]
        found: Index = self._first[stations] + np.array(levels, dtype=np.int64)
        return found

    def advance(self, e: int, target: int) -> bool:
        """Grasp or set down the object of a task; return whether the goal is reached."""
        move = self._moves(e)[target]
        if self.held[e] != NOTHING:
            self._states[e] = apply(self._states[e], self.shape, move)
            self._near[e] = near_optimal_moves(self._states[e], self.shape)
            self.held[e] = NOTHING
            self.moves[e] += 1
        else:
            slot, attempt = move.pick, int(self.attempts[e])
            risk = self._states[e].fail[slot] if slot < self.shape.n_slots else 0.0
            self.options[e] += len(self.targets[e])
            self.attempts[e] += 1
            if self._luck[e, attempt % N_DRAWS] >= risk:
                self.held[e] = slot
        if self._states[e].solved:
            return True
        self.targets[e], self.places[e] = self._targets(e), self._places(e)
        return False
