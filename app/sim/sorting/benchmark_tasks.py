"""The six tests of the sorting task: initial states and interference of people.

========= ============= ================================================================
name      K_E, K_G      content
========= ============= ================================================================
test-1    5, 5          sort everything
test-2    10, 10        the same with twice the objects
test-3    10, 5         every object of the goal has a duplicate in a riskier slot
test-4    5, 5          at the goal a larger object is added below sorted ones
test-5    8, 5          a duplicate is added during the task, then the goal changes
test-6    8, 3          three of one colour; the goal is then extended by three of another
========= ============= ================================================================

Evaluations and the live cell use the same definitions. Colours go to their own tower, the
largest object lowest.

Source: thesis 3.4.3, docs/method.md 1.5. Deviates: the thesis does not state how objects are
drawn; here every draw contains the situation that the test is about.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from app.errors import InvalidInput, NotFound
from app.sim.core.arrays import Vec
from app.sim.sorting.state import NULL, Codes, SortingShape, SortingState, empty_state

Start = Callable[[SortingShape, Vec, Generator], SortingState]
"""Draws an initial state from the shape and the failure probabilities, shape (K,)."""
Change = Callable[[SortingState, SortingShape, Generator], SortingState]
"""Draws the state after an interference."""
DRAWS = 100
"""Draws of a goal before the default one is used."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Interference:
    """Interference of a person in a test."""

    after_moves: int | None
    """Moves since the last interference; None: at the goal."""
    text: str
    """Description."""
    change: Change
    """The state afterwards."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SortingTest:
    """One of the six tests."""

    name: str
    """``test-1`` to ``test-6``."""
    title: str
    """Short title."""
    text: str
    """Description of the course."""
    n_objects: int
    """Objects at the start, ``K_E``."""
    n_goal: int
    """Objects of the first goal, ``K_G``."""
    start: Start
    """Draws the start."""
    expected: str
    """Expected behaviour."""
    safer_duplicates: bool = False
    """Whether each pick should select the safer of two duplicates."""
    interferences: tuple[Interference, ...] = ()
    """Interferences in order."""
    n_added: int = 0
    """Objects that are added meanwhile."""
    min_colours: int = 1
    """Colours it needs."""
    min_sizes: int = 1
    """Sizes it needs."""

    def fits(self, shape: SortingShape) -> bool:
        """Return whether a task is large enough for this test."""
        enough = shape.n_colours >= self.min_colours and shape.n_sizes >= self.min_sizes
        return enough and shape.n_slots >= self.n_objects + self.n_added


def sorted_goal(codes: Iterable[int], shape: SortingShape) -> Codes:
    """Return towers of the given objects, each on its colour's, the largest lowest."""
    goal = np.zeros((shape.n_colours, shape.n_slots), dtype=np.int8)
    heights = [0] * shape.n_colours
    for code in sorted((int(one) for one in codes), key=shape.size_of, reverse=True):
        colour = shape.colour_of(code)
        goal[colour, heights[colour]] = code
        heights[colour] += 1
    return goal


def _objects(codes: NDArray[np.int8]) -> NDArray[np.int8]:
    """Return the objects among codes, without free places."""
    return np.asarray(codes[codes != NULL])


def _scattered(
    codes: NDArray[np.int64], goal: Codes, shape: SortingShape, fail: Vec, rng: Generator
) -> SortingState:
    """Return a state with all objects in random clutter slots."""
    clutter = np.zeros(shape.n_slots, dtype=np.int8)
    clutter[rng.permutation(shape.n_slots)[: len(codes)]] = codes
    return replace(empty_state(shape), clutter=clutter, goal=goal, fail=fail.copy())


def _any(n: int, shape: SortingShape, rng: Generator) -> NDArray[np.int64]:
    return rng.integers(1, shape.n_types + 1, n)


def _with_duplicates(shape: SortingShape, fail: Vec, rng: Generator) -> SortingState:
    """Return five objects of the goal, each with a duplicate in a riskier slot.

    The safer one of each pair is in one of the ``n_slots // 2`` slots of least risk.
    """
    codes = _any(5, shape, rng)
    ranked = np.lexsort((rng.random(shape.n_slots), fail))
    safe, risky = np.split(ranked, [shape.n_slots // 2])
    clutter = np.zeros(shape.n_slots, dtype=np.int8)
    clutter[rng.permutation(safe)[:5]] = codes
    clutter[rng.permutation(risky)[:5]] = codes
    goal = sorted_goal(codes, shape)
    return replace(empty_state(shape), clutter=clutter, goal=goal, fail=fail.copy())


def _with_room_below(shape: SortingShape, fail: Vec, rng: Generator) -> SortingState:
    """Return five objects to sort, one of them at least not of the largest size."""
    codes = _any(5, shape, rng)
    small = rng.integers(0, shape.n_sizes - 1)
    codes[0] = shape.code(shape.colour_of(int(codes[0])), int(small))
    return _scattered(codes, sorted_goal(codes, shape), shape, fail, rng)


def _some(n_objects: int, n_goal: int) -> Start:
    """Return a start with random objects, the first ``n_goal`` of which are the goal."""

    def start(shape: SortingShape, fail: Vec, rng: Generator) -> SortingState:
        codes = _any(n_objects, shape, rng)
        goal = sorted_goal(codes[:n_goal], shape)
        return _scattered(codes, goal, shape, fail, rng)

    return start


def _of_two_colours(shape: SortingShape, fail: Vec, rng: Generator) -> SortingState:
    """Return eight objects, three of one colour at least and three of another.

    The goal asks for three of the first colour.
    """
    first, second = rng.permutation(shape.n_colours)[:2]
    colours = np.concatenate([np.repeat([first, second], 3), rng.choice([first, second], 2)])
    codes = 1 + colours * shape.n_sizes + rng.integers(0, shape.n_sizes, 8)
    wanted = rng.permutation(codes[colours == first])[:3]
    return _scattered(codes, sorted_goal(wanted, shape), shape, fail, rng)


def add_to_clutter(state: SortingState, code: int, rng: Generator) -> SortingState:
    """Return a state with one more object, in a random free clutter slot.

    Raises:
        InvalidInput: There is no free slot, or as many objects as slots.
    """
    free = np.flatnonzero(state.clutter == NULL)
    if len(free) == 0 or state.n_objects >= len(state.clutter):
        rule = "there is no room for another object"
        raise InvalidInput("objects", state.n_objects, rule)
    clutter = state.clutter.copy()
    clutter[rng.choice(free)] = code
    return replace(state, clutter=clutter)


def _add_below(state: SortingState, shape: SortingShape, rng: Generator) -> SortingState:
    """Add an object larger than the top of its tower to state and goal.

    Raises:
        InvalidInput: Nothing sorted could have a larger object below it, or there is no room.
    """
    tops = []
    for colour, height in enumerate(state.heights.tolist()):
        size = shape.size_of(int(state.towers[colour, height - 1]))
        if height and size < shape.n_sizes - 1:
            tops.append((colour, size))
    if not tops:
        rule = "must end in an object that is not of the largest size"
        raise InvalidInput("towers", state.towers.tolist(), rule)
    colour, size = tops[rng.integers(len(tops))]
    code = shape.code(colour, int(rng.integers(size + 1, shape.n_sizes)))
    goal = sorted_goal([*_objects(state.goal).tolist(), code], shape)
    return replace(add_to_clutter(state, code, rng), goal=goal)


def _add_alternative(state: SortingState, shape: SortingShape, rng: Generator) -> SortingState:
    """Add a duplicate of an object that is missing on the towers.

    Raises:
        InvalidInput: No object is missing on the towers, or no slot is free.
    """
    lack = np.bincount(_objects(state.goal), minlength=shape.n_types + 1)
    lack -= np.bincount(_objects(state.towers), minlength=shape.n_types + 1)
    asked = np.repeat(np.arange(len(lack)), np.maximum(lack, 0))
    if len(asked) == 0:
        rule = "must ask for an object that is on no tower yet"
        raise InvalidInput("goal", state.goal.tolist(), rule)
    return add_to_clutter(state, int(rng.choice(asked)), rng)


def _change_goal(state: SortingState, shape: SortingShape, rng: Generator) -> SortingState:
    """Change the goal so that some sorted objects must move again."""
    there = np.concatenate([_objects(state.clutter), _objects(state.towers)])
    n_goal = len(_objects(state.goal))
    for _ in range(DRAWS):
        goal = sorted_goal(rng.permutation(there)[:n_goal], shape)
        if ((state.towers != NULL) & (state.towers != goal)).any():
            return replace(state, goal=goal)
    return replace(state, goal=sorted_goal(_objects(state.goal)[1:], shape))


def _ask_for_another_colour(
    state: SortingState, shape: SortingShape, rng: Generator
) -> SortingState:
    """Add three objects of another colour to the goal.

    Raises:
        InvalidInput: The clutter holds no three of such a colour.
    """
    rest = _objects(state.clutter).astype(np.int64)
    colours = (rest - 1) // shape.n_sizes
    used = {shape.colour_of(int(code)) for code in _objects(state.goal)}
    counts = np.bincount(colours, minlength=shape.n_colours)
    free = [c for c in range(shape.n_colours) if counts[c] >= 3 and c not in used]
    if not free:
        rule = "must hold three objects of a colour that the goal does not ask for"
        raise InvalidInput("clutter", state.clutter.tolist(), rule)
    wanted = rng.permutation(rest[colours == free[0]])[:3]
    goal = sorted_goal([*_objects(state.goal).tolist(), *wanted.tolist()], shape)
    return replace(state, goal=goal)


TESTS: tuple[SortingTest, ...] = (
    SortingTest(
        name="test-1",
        title="Sort five blocks",
        text="Five blocks lie in clutter slots; the robot sorts all of them.",
        expected="Every block is sorted, without a contact.",
        n_objects=5,
        n_goal=5,
        start=_some(5, 5),
    ),
    SortingTest(
        name="test-2",
        title="Sort ten blocks",
        text="As the first test, with twice the blocks.",
        expected="Every block is sorted, without a contact.",
        n_objects=10,
        n_goal=10,
        start=_some(10, 10),
    ),
    SortingTest(
        name="test-3",
        title="Choose the lower-risk duplicate",
        text="Each of five blocks has a duplicate in a slot where picks fail more often.",
        expected="Every block is sorted, each from the safer slot, without a contact.",
        safer_duplicates=True,
        n_objects=10,
        n_goal=5,
        start=_with_duplicates,
    ),
    SortingTest(
        name="test-4",
        title="A larger block comes late",
        text="At the goal a person adds a larger block that belongs below sorted ones.",
        expected="The goal is reached, with the larger block as well, without a contact.",
        n_objects=5,
        n_goal=5,
        start=_with_room_below,
        interferences=(
            Interference(
                after_moves=None,
                text="A person adds a larger block, and the goal asks for it.",
                change=_add_below,
            ),
        ),
        n_added=1,
        min_sizes=2,
    ),
    SortingTest(
        name="test-5",
        title="An alternative, then another goal",
        text="A person adds a duplicate of a block, and changes the goal at its end.",
        expected="The goal is reached, and the changed goal as well, without a contact.",
        n_objects=8,
        n_goal=5,
        start=_some(8, 5),
        interferences=(
            Interference(
                after_moves=1,
                text="A person adds a duplicate of a block that is still to be sorted.",
                change=_add_alternative,
            ),
            Interference(
                after_moves=None,
                text="A person changes the goal: blocks that are sorted must move again.",
                change=_change_goal,
            ),
        ),
        n_added=1,
    ),
    SortingTest(
        name="test-6",
        title="One colour, then another",
        text="Three blocks of one colour; then the goal asks for three of another as well.",
        expected="The goal is reached, and the longer one as well, without a contact.",
        n_objects=8,
        n_goal=3,
        start=_of_two_colours,
        interferences=(
            Interference(
                after_moves=None,
                text="The goal is extended by three blocks of another colour.",
                change=_ask_for_another_colour,
            ),
        ),
        min_colours=2,
    ),
)
"""All six, in order."""


def sorting_test(name: str) -> SortingTest:
    """Return a test by its name.

    Raises:
        NotFound: There is none of that name.
    """
    for one in TESTS:
        if one.name == name:
            return one
    raise NotFound("sorting test", name, tuple(one.name for one in TESTS))
