"""The sorting task as progress of its towers, and the fewest moves from there, compiled.

A tower matches its goal up to level ``m``; what stands above must go, top first, and then the
goal is built, lowest level first. So a tower is described by one number, its *progress*: the
``R`` objects still above, one after the other, then the goal's levels ``cut .. G`` that stand.
Progress of all towers is a state: what lies in the clutter follows from it by counting. From a
state lead

- the removal of a tower's top to the clutter (there is always a free slot),
- the placement of a tower's next object from the clutter, where there is one,
- a tower's top straight onto a tower that wants it next: two moves' work in one,

and the fewest moves to the goal are shortest paths over all states, by sweeps from the goal.

**Why nothing else is needed.** An object put where the goal does not want it might as well lie
in the clutter, where it covers nothing: no plan with such a move is shorter (some are as
short, see :func:`ties_on_tower`). One thing more can shorten a plan: to take apart what
*matches*. With towers ``a = X``, ``b`` empty, ``e = X W V`` and goals ``a = X``, ``b = X V W``
the object of ``a`` is given to ``b`` and replaced at the end by that of ``e``: four moves, not
five. In a shortest plan the lowest object so taken from ``a`` goes straight onto another tower
``b``, and its duplicate comes straight from a third tower ``e`` (else leaving it is shorter).
``cut`` is the lowest level for which such ``b`` and ``e`` exist; mostly there are none, ``cut``
is ``m``, states follow one another in one order and one sweep is enough.

Source: docs/method.md 1.2; tests compare the number of moves with breadth-first search.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.jit import kernel

Ints = NDArray[np.int64]
Bytes = NDArray[np.int8]
FAR = 10_000
"""Moves from a state that was not reached yet."""


class ShortestPaths(NamedTuple):
    """The states of one task, and work space; made once, for any task of its shape."""

    n: Ints
    """Number of states of each tower, shape (C,)."""
    stride: Ints
    """Increment of the state's number per step of each tower, shape (C,)."""
    junk: Ints
    """Objects above the matching levels at the start, ``R``, shape (C,)."""
    match: Ints
    """Matching levels at the start, ``m``, shape (C,)."""
    cut: Ints
    """Lowest level that plans may take apart, shape (C,)."""
    at: Ints
    """Progress of each tower now, shape (C,)."""
    top: Bytes
    """Object on top by tower and progress, 0 where none may be taken, shape (C, 2 K + 1)."""
    want: Bytes
    """Object wanted next by tower and progress, 0 where none, shape (C, 2 K + 1)."""
    below: Ints
    """Progress after a removal, shape (C, 2 K + 1)."""
    held: NDArray[np.int16]
    """Objects of each code on a tower by progress, shape (C, 2 K + 1, 1 + codes)."""
    left: Ints
    """Objects of each code on no tower from the c-th on, shape (C + 1, 1 + codes)."""
    table: NDArray[np.int16]
    """Fewest moves from every state."""
    seen: Bytes
    """Work space of searches: zero outside of them; as ``table``."""
    line: NDArray[np.int32]
    """Work space of searches: states met; as ``table``."""


def most_states(n_slots: int, n_colours: int) -> int:
    """Return the largest number of states of a task, with K removals and K goals."""
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
def _stands(codes: Bytes, lowest: int, end: int, code: int) -> bool:
    """Return whether ``code`` is at one of the levels ``lowest .. end - 1``."""
    for level in range(lowest, end):
        if codes[level] == code:
            return True
    return False


@kernel()
def _lends(
    a: int, towers: Bytes, heights: Ints, goal: Bytes, goal_heights: Ints, p: ShortestPaths
) -> bool:
    """Return whether tower ``a`` might lend its object at level ``cut`` (module docstring)."""
    code = goal[a, p.cut[a]]
    for b in range(len(p.cut)):
        if b == a or not _stands(goal[b], p.cut[b], goal_heights[b], code):
            continue
        for e in range(len(p.cut)):
            if e not in (a, b) and _stands(towers[e], p.cut[e], heights[e], code):
                return True
    return False


@kernel()
def _find_cuts(
    towers: Bytes, heights: Ints, goal: Bytes, goal_heights: Ints, p: ShortestPaths
) -> None:
    """Write matching levels and cuts.

    Cuts rise from 0 as long as one's object has no tower to go to or none to come from: what
    remains is at or below the cut of every shortest plan.
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
            while p.cut[c] < p.match[c] and not _lends(
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
    """Write the states of one tower: top, want, below and held."""
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
        goal_heights: Objects per tower there, shape (C,).
        p: The states, written.

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
    """Write ``left`` of the towers up to ``c``, except the first."""
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
        at: Work space, shape (C,).
        p: The states; ``table`` is written.
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
    """Return the number of the state that the towers are in now."""
    index = 0
    for c in range(len(p.at)):
        index += p.at[c] * p.stride[c]
    return index


@kernel()
def in_clutter(index: int, code: int, p: ShortestPaths) -> int:
    """Return the number of objects of a code in the clutter."""
    n_towers = len(p.n)
    count: int = p.left[n_towers, code]
    for c in range(n_towers):
        count -= p.held[c, index // p.stride[c] % p.n[c], code]
    return count


@kernel()
def _meet(index: int, found: int, p: ShortestPaths) -> int:
    """Add a state to the search, once; return the number of states."""
    if p.seen[index] == 0:
        p.seen[index] = 1
        p.line[found] = index
        found += 1
    return found


@kernel()
def _search_from(index: int, still: int, code: int, found: int, p: ShortestPaths) -> int:
    """Add the states on shortest plans from one while tower ``still`` is unchanged.

    Returns:
        Number of states noted; -1 where ``code`` may be placed from the clutter here.
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
            found = _meet(placed, found, p)
        if top == 0:
            continue
        removed = index + (p.below[d, q] - q) * p.stride[d]
        if p.table[removed] == wanted:
            found = _meet(removed, found, p)
        for e in range(len(p.n)):
            if e in (d, still) or p.want[e, index // p.stride[e] % p.n[e]] != top:
                continue
            if p.table[removed + p.stride[e]] == wanted:
                found = _meet(removed + p.stride[e], found, p)
    return found


@kernel()
def ties_on_tower(index: int, still: int, code: int, p: ShortestPaths) -> bool:
    """Return whether a tower that does not need a removed object is as good as the clutter.

    It is if some shortest plan places an object of its code from the clutter before that tower
    changes; the object then comes from the tower instead.

    Args:
        index: State after the removal to the clutter, on a shortest plan.
        still: Tower on which it is put.
        p: The states, ``table`` filled.
    """
    found = _meet(index, 0, p)
    looked, ties = 0, False
    while looked < found and not ties:
        more = _search_from(p.line[looked], still, code, found, p)
        looked += 1
        ties = more < 0
        found = max(found, more)
    for i in range(found):
        p.seen[p.line[i]] = 0
    return ties
