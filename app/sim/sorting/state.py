"""State of the sorting task as integers, and its moves (docs/method.md 1.1 and 1.2).

An object is a *code*: 0 for a free place, others ``1 + colour * n_sizes + size``, with sizes
from the smallest. Objects of one code are identical. There are ``K`` clutter slots and one
tower per colour with ``K`` levels and no gaps, for any objects.

Position ``k`` is a clutter slot, ``K + c`` the top of tower ``c``. Moves are numbered as the
outputs of a network:

| action | move |
|---|---|
| ``k * C + c`` | clutter slot ``k`` to tower ``c`` |
| ``K * C + c * K + k`` | top of tower ``c`` to clutter slot ``k`` |
| ``2 * K * C + c * C + d`` | top of tower ``c`` to ``d``; ``c == d`` is the *stuck* move |

Source: thesis eq. (3.7)-(3.17). Deviates: tower to tower is a move (docs/method.md 1.2), and
the number of colours excludes the null colour (1.1).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.errors import InvalidInput
from app.sim.cells.parts import MAX_FAILURE
from app.sim.core.arrays import Vec

Codes = NDArray[np.int8]
"""Objects by code."""

MAX_SLOTS = 40
"""Largest number of clutter slots and of objects."""
MAX_COLOURS = 5
"""Largest number of colours and of towers."""
MAX_SIZES = 5
"""Largest number of sizes."""
NULL = 0
"""Code of the null object."""
SIZE_NAMES = {
    1: ("medium",),
    2: ("small", "large"),
    3: ("small", "medium", "large"),
    4: ("small", "medium", "large", "huge"),
    5: ("tiny", "small", "medium", "large", "huge"),
}
"""Names of sizes by their number, from the smallest."""


@dataclass(frozen=True, slots=True, order=True)
class Move:
    """Pick the object at one position and place it at another."""

    pick: int
    """Position of the pick."""
    place: int
    """Position of the place."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SortingShape:
    """Shape of a sorting task.

    Raises:
        InvalidInput: A number outside its bounds.
    """

    n_slots: int
    """Number ``K`` of clutter slots, of levels of a tower, and largest number of objects."""
    n_colours: int
    """Number ``C`` of colours and towers."""
    n_sizes: int = 3
    """Number ``S`` of sizes."""

    def __post_init__(self) -> None:
        for name, value, most in (
            ("n_slots", self.n_slots, MAX_SLOTS),
            ("n_colours", self.n_colours, MAX_COLOURS),
            ("n_sizes", self.n_sizes, MAX_SIZES),
        ):
            if not 1 <= value <= most:
                raise InvalidInput(name, value, f"must lie in [1, {most}]")

    def __str__(self) -> str:
        """Return the numbers in words, for messages."""
        return f"{self.n_slots} slots, {self.n_colours} colours, {self.n_sizes} sizes"

    @property
    def n_types(self) -> int:
        """Number of different objects."""
        return self.n_colours * self.n_sizes

    @property
    def n_actions(self) -> int:
        """Number of moves, valid or not."""
        return self.n_colours * (2 * self.n_slots + self.n_colours)

    @property
    def obs_size(self) -> int:
        """Numbers of an observation: slots, towers, goal, failure percentages."""
        return 2 * self.n_slots * (1 + self.n_colours)

    def code(self, colour: int, size: int) -> int:
        """Return the code of an object."""
        return 1 + colour * self.n_sizes + size

    def colour_of(self, code: int) -> int:
        """Return the colour of an object."""
        return (code - 1) // self.n_sizes

    def size_of(self, code: int) -> int:
        """Return the size of an object, 0 the smallest."""
        return (code - 1) % self.n_sizes

    def move_of(self, action: int) -> Move:
        """Return the move of an action."""
        k, c = self.n_slots, self.n_colours
        if not 0 <= action < self.n_actions:
            raise InvalidInput("action", action, f"must lie in [0, {self.n_actions})")
        if action < k * c:
            return Move(action // c, k + action % c)
        if action < 2 * k * c:
            return Move(k + (action - k * c) // k, (action - k * c) % k)
        return Move(k + (action - 2 * k * c) // c, k + (action - 2 * k * c) % c)

    def action_of(self, move: Move) -> int:
        """Return the action of a move.

        Raises:
            InvalidInput: No such positions, or from one clutter slot to another.
        """
        k, c = self.n_slots, self.n_colours
        for name, position in (("pick", move.pick), ("place", move.place)):
            if not 0 <= position < k + c:
                raise InvalidInput(name, position, f"must lie in [0, {k + c})")
        if move.pick < k:
            if move.place < k:
                raise InvalidInput("place", move.place, "must be a tower for a clutter slot")
            return move.pick * c + move.place - k
        if move.place < k:
            return k * c + (move.pick - k) * k + move.place
        return 2 * k * c + (move.pick - k) * c + move.place - k


@dataclass(frozen=True, slots=True, kw_only=True)
class SortingState:
    """One sorting task at one moment."""

    clutter: Codes
    """Objects in the clutter slots, shape (K,)."""
    towers: Codes
    """Objects on the towers, lowest level first, shape (C, K)."""
    goal: Codes
    """Goal of the towers, shape (C, K)."""
    fail: Vec
    """Failure probability of a pick from each clutter slot, shape (K,)."""

    @property
    def heights(self) -> NDArray[np.int64]:
        """Objects per tower, shape (C,)."""
        return np.asarray((self.towers != NULL).sum(axis=1))

    @property
    def n_objects(self) -> int:
        """Objects in the cell."""
        return int((self.clutter != NULL).sum() + (self.towers != NULL).sum())

    @property
    def solved(self) -> bool:
        """Whether every tower equals its goal."""
        return bool((self.towers == self.goal).all())


def empty_state(shape: SortingShape) -> SortingState:
    """Return a state without objects, goal or risk, to be filled."""
    k, c = shape.n_slots, shape.n_colours
    return SortingState(
        clutter=np.zeros(k, dtype=np.int8),
        towers=np.zeros((c, k), dtype=np.int8),
        goal=np.zeros((c, k), dtype=np.int8),
        fail=np.zeros(k),
    )


def code_counts(codes: Codes, shape: SortingShape) -> NDArray[np.int64]:
    """Return the number of objects per code, shape (n_types + 1,); index 0: free places."""
    return np.bincount(codes.ravel().astype(np.int64), minlength=shape.n_types + 1)


def missing(state: SortingState, shape: SortingShape) -> NDArray[np.int64]:
    """Return the number of missing objects per code of the goal, shape (n_types + 1,)."""
    there = code_counts(state.clutter, shape) + code_counts(state.towers, shape)
    lack = np.maximum(code_counts(state.goal, shape) - there, 0)
    lack[NULL] = 0
    return lack


def check_state(state: SortingState, shape: SortingShape) -> None:
    """Check a state that came from outside.

    Raises:
        InvalidInput: Another shape, an unknown code, a tower with a gap, too many objects, a
            goal that the objects cannot meet, or a failure probability outside [0, 0.99].
    """
    k, c = shape.n_slots, shape.n_colours
    for name, codes, wanted in (
        ("clutter", state.clutter, (k,)),
        ("towers", state.towers, (c, k)),
        ("goal", state.goal, (c, k)),
    ):
        if codes.shape != wanted:
            raise InvalidInput(name, list(codes.shape), f"must have the shape {list(wanted)}")
        if ((codes < 0) | (codes > shape.n_types)).any():
            raise InvalidInput(name, codes.tolist(), f"must hold codes in [0, {shape.n_types}]")
        if codes.ndim == 2 and ((codes[:, 1:] != NULL) & (codes[:, :-1] == NULL)).any():
            raise InvalidInput(name, codes.tolist(), "must have no gap below an object")
    if state.fail.shape != (k,):
        raise InvalidInput("fail", list(state.fail.shape), f"must have the shape [{k}]")
    bad = ~((state.fail >= 0.0) & (state.fail <= MAX_FAILURE))
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        rule = f"must lie in [0, {MAX_FAILURE}]"
        raise InvalidInput(f"fail[{first}]", float(state.fail[first]), rule)
    if state.n_objects > k:
        raise InvalidInput("objects", state.n_objects, f"must be at most {k}")
    lack = missing(state, shape)
    if lack.any():
        rule = "must be met by the objects: these codes are missing"
        raise InvalidInput("goal", np.flatnonzero(lack).tolist(), rule)
