"""State graph of a sorting task, and the fewest moves to its goal (compiled).

A tower matches its goal in its lowest ``m`` levels. The objects above must be removed, top
first, before the rest of the goal is built, lowest level first. A tower is therefore described
by one number, its *progress*: it counts the ``R`` removals that remain, then the levels of the
goal from ``cut`` on that are built. The progress of all towers is a state; the contents of the
clutter follow from it by counting. Moves from a state are

- the removal of a tower's top object to the clutter (there is always a free slot),
- the placement of a tower's next object from the clutter, if it is there,
- the transfer of a tower's top object to a tower that needs it next, which replaces a removal
  and a placement.

The fewest moves to the goal are shortest paths in this graph, found by sweeps from the goal.

**Why other moves are not needed.** An object on a tower that does not need it could as well be
in the clutter, where it covers nothing: plans with such a move are never shorter (some are
equally short, see :func:`ties_on_tower`). Only one other move can shorten a plan: the removal
of an object that *matches*. With towers ``a = X``, ``b`` empty, ``e = X W V`` and goals
``a = X``, ``b = X V W``, the object of ``a`` is transferred to ``b`` and replaced at the end by
that of ``e``: four moves instead of five. In a shortest plan the lowest object removed so from
``a`` is transferred to another tower ``b``, and its duplicate comes from a third tower ``e``
(otherwise leaving it is shorter). ``cut`` is the lowest level for which such towers ``b`` and
``e`` exist. Mostly there are none: then ``cut`` is ``m``, and one sweep is enough.

Notation: K clutter slots, C towers, codes of objects as in ``state.py`` (0: no object).

Source: docs/method.md 1.2; tests compare the number of moves with breadth-first search.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.jit import kernel

Ints = NDArray[np.int64]
Bytes = NDArray[np.int8]
FAR = 10_000
"""Number of moves of a state from which no path is known yet."""


class ShortestPaths(NamedTuple):
    """State graph of one task, and work space; reused for all tasks of a shape."""

    n: Ints
    """Number of states of each tower, shape (C,)."""
    stride: Ints
    """Increment of the state's number per step of each tower, shape (C,)."""
    junk: Ints
    """Objects above the matching levels at the start (``R``), shape (C,)."""
    match: Ints
    """Matching levels at the start (``m``), shape (C,)."""
    cut: Ints
    """Lowest matching level that a plan may remove, shape (C,)."""
    at: Ints
    """Present progress of each tower, shape (C,)."""
    top: Bytes
    """Code of the top object by tower and progress, 0 if none may be removed, (C, 2 K + 1)."""
    want: Bytes
    """Code of the next object by tower and progress, 0 if none, shape (C, 2 K + 1)."""
    below: Ints
    """Progress after a removal, by tower and progress, shape (C, 2 K + 1)."""
    held: NDArray[np.int16]
    """Objects of each code on a tower by progress, shape (C, 2 K + 1, 1 + codes)."""
    left: Ints
    """Objects of each code on none of the towers c, c + 1, ..., shape (C + 1, 1 + codes)."""
    table: NDArray[np.int16]
    """Fewest moves to the goal by number of the state, shape (most_states,)."""
    seen: Bytes
    """1 for states that a search has found; zero between searches, shape (most_states,)."""
    line: NDArray[np.int32]
    """Numbers of the states that a search has found, shape (most_states,)."""


def most_states(n_slots: int, n_colours: int) -> int:
    """Return the largest number of states of a task: K removals and K levels of goals."""
    each, more = divmod(2 * n_slots, n_colours)
    return int((each + 2) ** more * (each + 1) ** (n_colours - more))


def new_shortest_paths(n_slots: int, n_colours: int, n_sizes: int) -> ShortestPaths:
    """Return work space for tasks of a shape: 7 bytes per state, 10 MB for K = 40, C = 5."""
    c, length = n_colours, 2 * n_slots + 1
    n_codes, size = 1 + n_colours * n_sizes, most_states(n_slots, n_colours)
    return ShortestPaths(
        n=np.zeros(c, dtype=np.int64),
        stride=np.zeros(c, dtype=np.int64),
        junk=np.zeros(c, dtype=np.int64),
        match=np.zeros(c, dtype=np.int64),
        cut=np.zeros(c, dtype=np.int64),
        at=np.zeros(c, dtype=np.int64),
        top=np.zeros((c, length), dtype=np.int8),
        want=np.zeros((c, length), dtype=np.int8),
        below=np.zeros((c, length), dtype=np.int64),
        held=np.zeros((c, length, n_codes), dtype=np.int16),
        left=np.zeros((c + 1, n_codes), dtype=np.int64),
        table=np.empty(size, dtype=np.int16),
        seen=np.zeros(size, dtype=np.int8),
        line=np.empty(size, dtype=np.int32),
    )


@kernel()
def _holds(codes: Bytes, lowest: int, end: int, code: int) -> bool:
    """Return whether ``code`` is at one of the levels ``lowest .. end - 1``."""
    for level in range(lowest, end):
        if codes[level] == code:
            return True
    return False


@kernel()
def _can_donate(
    a: int, towers: Bytes, heights: Ints, goal: Bytes, goal_heights: Ints, p: ShortestPaths
) -> bool:
    """Return whether a tower needs the object of ``a`` at ``cut``, and a third has another."""
    code = goal[a, p.cut[a]]
    for b in range(len(p.cut)):
        if b == a or not _holds(goal[b], p.cut[b], goal_heights[b], code):
            continue
        for e in range(len(p.cut)):
            if e not in (a, b) and _holds(towers[e], p.cut[e], heights[e], code):
                return True
    return False


@kernel()
def _find_cuts(
    towers: Bytes, heights: Ints, goal: Bytes, goal_heights: Ints, p: ShortestPaths
) -> None:
    """Write ``match``, ``junk`` and ``cut``.

    A cut rises from 0 while no tower needs its object or none has a duplicate: no shortest plan
    removes a matching object below it.
    """
    c_most = len(p.cut)
    for c in range(c_most):
        m = 0
        while m < min(heights[c], goal_heights[c]) and towers[c, m] == goal[c, m]:
            m += 1
        p.match[c], p.junk[c] = m, heights[c] - m
        p.cut[c] = 0 if c_most > 2 else m
    rising = c_most > 2
    while rising:
        rising = False
        for c in range(c_most):
            while p.cut[c] < p.match[c] and not _can_donate(
                c, towers, heights, goal, goal_heights, p
            ):
                p.cut[c] += 1
                rising = True


@kernel()
def _add(held: NDArray[np.int16], source: int, target: int, code: int) -> None:
    """Write the held objects at ``target``: those at ``source`` and one more."""
    for x in range(held.shape[1]):
        held[target, x] = held[source, x]
    held[target, code] += 1


@kernel()
def _lay_tower(c: int, tower: Bytes, goal: Bytes, goal_height: int, p: ShortestPaths) -> None:
    """Write ``top``, ``want``, ``below`` and ``held`` of one tower by progress."""
    junk, match, cut = p.junk[c], p.match[c], p.cut[c]
    held = p.held[c]
    for x in range(held.shape[1]):
        held[junk, x] = 0
    for level in range(cut):
        held[junk, goal[level]] += 1
    for level in range(cut, goal_height + 1):
        q = junk + level - cut
        p.top[c, q] = goal[level - 1] if level > cut else 0
        p.want[c, q] = goal[level] if level < goal_height else 0
        p.below[c, q] = q - 1
        if level > cut:
            _add(held, q - 1, q, goal[level - 1])
    above = junk + match - cut
    for q in range(junk - 1, -1, -1):
        code = tower[match + junk - q - 1]
        p.top[c, q], p.want[c, q], p.below[c, q] = code, 0, above
        _add(held, above, q, code)
        above = q
    p.at[c] = above
    p.n[c] = junk + goal_height - cut + 1


@kernel()
def _can_be_met(
    clutter: Bytes, towers: Bytes, heights: Ints, goal: Bytes, goal_heights: Ints, total: Ints
) -> bool:
    """Count the objects of each code; return whether the goal is feasible."""
    for x in range(len(total)):
        total[x] = 0
    for code in clutter:
        total[code] += 1
    n_objects = len(clutter) - total[0]
    for c in range(len(towers)):
        n_objects += heights[c]
        for level in range(heights[c]):
            total[towers[c, level]] += 1
    for x in range(1, len(total)):
        lack = -total[x]
        for c in range(len(goal)):
            for level in range(goal_heights[c]):
                lack += goal[c, level] == x
        if lack > 0:
            return False
    return bool(n_objects <= len(clutter))


@kernel()
def lay_out(
    clutter: Bytes,
    towers: Bytes,
    heights: Ints,
    goal: Bytes,
    goal_heights: Ints,
    p: ShortestPaths,
) -> int:
    """Write the states of a task.

    Args:
        clutter: Objects in the slots, shape (K,).
        towers: Objects on the towers, lowest first, shape (C, K).
        heights: Objects per tower, shape (C,).
        goal: Goal of the towers, shape (C, K).
        goal_heights: Objects per tower of the goal, shape (C,).
        p: State graph; all but ``table`` is written.

    Returns:
        Number of states; 0 where the goal cannot be met, or there are more than K objects.
    """
    n_towers, size = len(towers), 1
    if not _can_be_met(clutter, towers, heights, goal, goal_heights, p.left[n_towers]):
        return 0
    _find_cuts(towers, heights, goal, goal_heights, p)
    for c in range(n_towers):
        _lay_tower(c, towers[c], goal[c], goal_heights[c], p)
        p.stride[c] = size
        size *= p.n[c]
    return size


@kernel()
def _count_left(c: int, at: Ints, p: ShortestPaths) -> None:
    """Write ``left`` of the towers 1 to ``c`` at the progress ``at``, shape (C,)."""
    for d in range(c, 0, -1):
        for x in range(p.left.shape[1]):
            p.left[d, x] = p.left[d + 1, x] - p.held[d, at[d], x]


@kernel()
def _fewest_from(index: int, at: Ints, p: ShortestPaths) -> int:
    """Return the fewest moves from a state, by those of its successors."""
    best = FAR
    for c in range(len(at)):
        want = p.want[c, at[c]]
        if want != 0 and p.left[1, want] > p.held[0, at[0], want]:
            best = min(best, p.table[index + p.stride[c]])
        top = p.top[c, at[c]]
        if top == 0:
            continue
        removed = index + (p.below[c, at[c]] - at[c]) * p.stride[c]
        best = min(best, p.table[removed])
        for d in range(len(at)):
            if d != c and p.want[d, at[d]] == top:
                best = min(best, p.table[removed + p.stride[d]])
    return best + 1


@kernel()
def _sweep(size: int, at: Ints, p: ShortestPaths) -> bool:
    """Improve all states once, from the goal; return whether any changed."""
    better = False
    for c in range(len(at)):
        at[c] = p.n[c] - 1
    _count_left(len(at) - 1, at, p)
    for index in range(size - 1, -1, -1):
        fewest = _fewest_from(index, at, p)
        if fewest < p.table[index]:
            p.table[index] = fewest
            better = True
        c = 0
        while c < len(at) - 1 and at[c] == 0:
            at[c] = p.n[c] - 1
            c += 1
        at[c] -= 1
        if index > 0:
            _count_left(c, at, p)
    return better


@kernel()
def fill(size: int, at: Ints, p: ShortestPaths) -> None:
    """Write the fewest moves from every state.

    Args:
        size: Number of states.
        at: Work space for the progress of each tower, shape (C,).
        p: State graph; ``table`` is written.
    """
    for index in range(size - 1):
        p.table[index] = FAR
    p.table[size - 1] = 0
    ordered = True
    for c in range(len(p.cut)):
        ordered = ordered and p.cut[c] == p.match[c]
    while _sweep(size, at, p) and not ordered:
        pass


@kernel()
def state_number(p: ShortestPaths) -> int:
    """Return the number of the present state, that of the progress ``at``."""
    index = 0
    for c in range(len(p.at)):
        index += p.at[c] * p.stride[c]
    return index


@kernel()
def in_clutter(index: int, code: int, p: ShortestPaths) -> int:
    """Return the number of objects of a code in the clutter in the state ``index``."""
    n_towers = len(p.n)
    count: int = p.left[n_towers, code]
    for c in range(n_towers):
        count -= p.held[c, index // p.stride[c] % p.n[c], code]
    return count


@kernel()
def _add_state(index: int, found: int, p: ShortestPaths) -> int:
    """Add a state to the search, once; return the number of states found."""
    if p.seen[index] == 0:
        p.seen[index] = 1
        p.line[found] = index
        found += 1
    return found


@kernel()
def _search_from(index: int, still: int, code: int, found: int, p: ShortestPaths) -> int:
    """Add the states on shortest plans from one while tower ``still`` is unchanged.

    Returns:
        Number of states found; -1 where ``code`` may be placed from the clutter here.
    """
    wanted = p.table[index] - 1
    for d in range(len(p.n)):
        if d == still:
            continue
        q = index // p.stride[d] % p.n[d]
        want, top = p.want[d, q], p.top[d, q]
        placed = index + p.stride[d]
        if want != 0 and p.table[placed] == wanted and in_clutter(index, want, p) > 0:
            if want == code:
                return -1
            found = _add_state(placed, found, p)
        if top == 0:
            continue
        removed = index + (p.below[d, q] - q) * p.stride[d]
        if p.table[removed] == wanted:
            found = _add_state(removed, found, p)
        for e in range(len(p.n)):
            if e in (d, still) or p.want[e, index // p.stride[e] % p.n[e]] != top:
                continue
            if p.table[removed + p.stride[e]] == wanted:
                found = _add_state(removed + p.stride[e], found, p)
    return found


@kernel()
def ties_on_tower(index: int, still: int, code: int, p: ShortestPaths) -> bool:
    """Return whether a tower that does not need a removed object is as good as the clutter.

    It is if some shortest plan places an object of its code from the clutter before that tower
    changes; the object then comes from the tower instead.

    Args:
        index: State after the removal to the clutter, on a shortest plan.
        still: Tower on which it is put.
        code: Code of the object.
        p: State graph, ``table`` filled.
    """
    found = _add_state(index, 0, p)
    looked, ties = 0, False
    while looked < found and not ties:
        more = _search_from(p.line[looked], still, code, found, p)
        looked += 1
        ties = more < 0
        found = max(found, more)
    for i in range(found):
        p.seen[p.line[i]] = 0
    return ties
