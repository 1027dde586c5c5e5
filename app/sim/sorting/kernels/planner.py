"""Exact plans of the sorting task (compiled).

A pick from slot ``k`` takes ``1 / (1 - fail[k])`` attempts on average; picks from towers do not
fail. Among plans with the fewest moves, one with few expected attempts is found by rules
(:mod:`app.sim.sorting.kernels.tie_breaking`) and one-step rollouts: where the rules put aside
an object that is needed later, every alternative is simulated with the rules, and the best is
selected. ``tools/docs/planner_optimality.py`` compares the result with the optimum.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.sorting.kernels.shortest_paths import (
    Bytes,
    Ints,
    ShortestPaths,
    fill,
    lay_out,
    new_shortest_paths,
    state_number,
    ties_on_tower,
)
from app.sim.sorting.kernels.tie_breaking import (
    NONE,
    choose,
    mark_first,
    still_wanted,
    worst_free,
)

MAX_STATES = 20_000
"""Largest number of states with rollouts; larger tasks would take seconds."""
LESS = 1e-9
"""Least reduction of attempts by a preferred plan."""
SLOTS_TRIED = 3
"""Number of best free slots tried for an object put aside, besides the worst one."""


class Objects(NamedTuple):
    """Positions of the objects in a plan."""

    clutter: Bytes
    """Objects in the slots, shape (K,)."""
    towers: Bytes
    """Objects on the towers, lowest first, shape (C, K)."""
    heights: Ints
    """Objects per tower, shape (C,)."""


class Task(NamedTuple):
    """Goal and failure probabilities."""

    goal: Bytes
    """Goal of the towers, shape (C, K)."""
    goal_heights: Ints
    """Objects per tower of the goal, shape (C,)."""
    fail: Vec
    """Failure probabilities of the slots, shape (K,)."""


class PlannerWork(NamedTuple):
    """Work space of the planner for one shape."""

    paths: ShortestPaths
    """State graph of the task."""
    at: Ints
    """Work space: progress of each tower in a sweep, shape (C,)."""
    now: Objects
    """Objects along the present plan."""
    trial: Objects
    """Objects along an alternative plan."""
    first: NDArray[np.bool_]
    """Whether some shortest plan begins with each action, shape (n_actions,)."""
    actions: Ints
    """The plan that was followed, then -1, shape (4 K + 1,)."""


def _new_objects(n_slots: int, n_colours: int) -> Objects:
    """Return work space for the objects of a task."""
    return Objects(
        clutter=np.zeros(n_slots, dtype=np.int8),
        towers=np.zeros((n_colours, n_slots), dtype=np.int8),
        heights=np.zeros(n_colours, dtype=np.int64),
    )


def new_work(n_slots: int, n_colours: int, n_sizes: int) -> PlannerWork:
    """Return work space: 30 kB for K = 20 slots, C = 3 towers; 10 MB for K = 40, C = 5."""
    return PlannerWork(
        paths=new_shortest_paths(n_slots, n_colours, n_sizes),
        at=np.zeros(n_colours, dtype=np.int64),
        now=_new_objects(n_slots, n_colours),
        trial=_new_objects(n_slots, n_colours),
        first=np.zeros(n_colours * (2 * n_slots + n_colours), dtype=np.bool_),
        actions=np.zeros(4 * n_slots + 1, dtype=np.int64),
    )


@kernel()
def copy_objects(source: Objects, target: Objects) -> None:
    """Copy the positions of the objects."""
    for k in range(len(source.clutter)):
        target.clutter[k] = source.clutter[k]
    for c in range(len(source.heights)):
        target.heights[c] = source.heights[c]
        for level in range(len(source.clutter)):
            target.towers[c, level] = source.towers[c, level]


@kernel()
def lay_out_task(objects: Objects, task: Task, work: PlannerWork) -> int:
    """Write the state graph of a task with the fewest moves; return its number of states."""
    size = lay_out(
        objects.clutter,
        objects.towers,
        objects.heights,
        task.goal,
        task.goal_heights,
        work.paths,
    )
    if size > 0:
        fill(size, work.at, work.paths)
    return size


@kernel()
def _locate(objects: Objects, task: Task, p: ShortestPaths) -> None:
    """Write the progress ``at`` of the towers."""
    for c in range(len(objects.heights)):
        height, level = objects.heights[c], 0
        while level < height and objects.towers[c, level] == task.goal[c, level]:
            level += 1
        p.at[c] = p.junk[c] + (height - p.cut[c] if level == height else p.match[c] - height)


@kernel()
def _apply_action(action: int, objects: Objects, task: Task, work: PlannerWork) -> bool:
    """Execute an action and update the towers' progress.

    Returns:
        Whether the state graph was written again: the object is on a tower that does not need
        it next.
    """
    p, n_slots, n_towers = work.paths, len(objects.clutter), len(objects.heights)
    moves = n_slots * n_towers
    d = action % n_towers
    if action < moves:
        code = objects.clutter[action // n_towers]
        objects.clutter[action // n_towers] = 0
    else:
        c = (
            (action - moves) // n_slots
            if action < 2 * moves
            else (action - 2 * moves) // n_towers
        )
        objects.heights[c] -= 1
        code = objects.towers[c, objects.heights[c]]
        objects.towers[c, objects.heights[c]] = 0
        p.at[c] = p.below[c, p.at[c]]
        if action < 2 * moves:
            objects.clutter[(action - moves) % n_slots] = code
            return False
        d = (action - 2 * moves) % n_towers
    objects.towers[d, objects.heights[d]] = code
    objects.heights[d] += 1
    if p.want[d, p.at[d]] == code:
        p.at[d] += 1
        return False
    lay_out_task(objects, task, work)
    return True


@kernel()
def _attempts(action: int, task: Task) -> float:
    """Return the expected attempts of an action."""
    k = action // len(task.goal)
    return 1.0 / (1.0 - task.fail[k]) if k < len(task.fail) else 1.0


@kernel()
def _choose(objects: Objects, task: Task, p: ShortestPaths) -> int:
    """Return the next action by the rules, -1 at the goal."""
    return choose(objects.clutter, task.goal, task.goal_heights, task.fail, p)


@kernel()
def _try(action: int, best: float, task: Task, work: PlannerWork) -> float:
    """Return the expected attempts from an action to the goal, by the rules after it.

    Args:
        action: First action, from ``work.now``.
        best: Least expected attempts so far; the evaluation ends when they are exceeded.
        task: Goal and failure probabilities.
        work: Work space whose state graph fits ``work.now``, before and after the call.
    """
    p = work.paths
    copy_objects(work.now, work.trial)
    attempts, rewritten = 0.0, False
    while action >= 0 and attempts < best:
        attempts += _attempts(action, task)
        rewritten = _apply_action(action, work.trial, task, work) or rewritten
        action = _choose(work.trial, task, p)
    if rewritten:
        lay_out_task(work.now, task, work)
    else:
        _locate(work.now, task, p)
    return attempts


@kernel()
def _next_free(last: int, clutter: Bytes, fail: Vec) -> int:
    """Return the next free slot by risk after ``last`` (-1: the best), -1 after the worst."""
    found = -1
    for k in range(len(clutter)):
        if clutter[k] != 0 or k == last:
            continue
        later = last < 0 or fail[k] > fail[last] or (fail[k] == fail[last] and k > last)
        if later and (found < 0 or fail[k] < fail[found]):
            found = k
    return found


@kernel()
def _try_slots(c: int, best: float, task: Task, work: PlannerWork) -> tuple[int, float]:
    """Evaluate the best free slots and the worst one for the top of a tower.

    Args:
        c: The tower.
        best: Least expected attempts so far.
        task: Goal and failure probabilities.
        work: Work space whose state graph fits ``work.now``.

    Returns:
        The best such action, -1 where none is better, and the expected attempts then.
    """
    now, n_slots = work.now, len(work.now.clutter)
    base = n_slots * len(now.heights) + c * n_slots
    chosen, k = NONE, -1
    for n in range(SLOTS_TRIED + 1):
        if n < SLOTS_TRIED:
            k = _next_free(k, now.clutter, task.fail)
        elif k >= 0:
            worst = worst_free(now.clutter, task.fail)
            k = worst if worst != k else -1
        if k < 0:
            break
        attempts = _try(base + k, best, task, work)
        if attempts < best - LESS:
            chosen, best = base + k, attempts
    return chosen, best


@kernel()
def _waiting(c: int, removed: int, p: ShortestPaths) -> int:
    """Return a tower that can hold the top of another at no cost; -1 without one.

    Args:
        c: The other tower.
        removed: State after a removal to the clutter instead, on a shortest plan.
        p: State graph, ``table`` filled; ``at`` is the present state.
    """
    top = p.top[c, p.at[c]]
    for d in range(len(p.at)):
        if d != c and p.want[d, p.at[d]] != top and ties_on_tower(removed, d, top, p):
            return d
    return -1


@kernel()
def _best_of_alternatives(task: Task, work: PlannerWork) -> int:
    """Return the next action of the plan, -1 at the goal.

    Args:
        task: Goal and failure probabilities.
        work: Work space whose state graph fits ``work.now``.
    """
    p, now = work.paths, work.now
    chosen = _choose(now, task, p)
    n_slots, n_towers = len(now.clutter), len(now.heights)
    moves = n_slots * n_towers
    if not moves <= chosen < 2 * moves:
        return chosen
    top = p.top[(chosen - moves) // n_slots, p.at[(chosen - moves) // n_slots]]
    if still_wanted(top, task.goal, task.goal_heights, p) == 0:
        return chosen
    best, index = np.inf, state_number(p)
    for c in range(n_towers):
        top = p.top[c, p.at[c]]
        removed = index + (p.below[c, p.at[c]] - p.at[c]) * p.stride[c]
        if top == 0 or p.table[removed] != p.table[index] - 1:
            continue
        d = _waiting(c, removed, p)
        if d < 0:
            action, attempts = _try_slots(c, best, task, work)
        else:
            action = 2 * moves + c * n_towers + d
            attempts = _try(action, best, task, work)
        if attempts < best - LESS:
            chosen, best = action, attempts
    return chosen


@kernel()
def next_action(size: int, task: Task, work: PlannerWork) -> int:
    """Return the next action of the plan, -1 at the goal.

    Args:
        size: Number of states.
        task: Goal and failure probabilities.
        work: Work space whose state graph fits ``work.now``.
    """
    if size > MAX_STATES:
        return _choose(work.now, task, work.paths)
    return _best_of_alternatives(task, work)


@kernel(nogil=True)
def plan_state(objects: Objects, task: Task, work: PlannerWork) -> tuple[int, float]:
    """Plan one state to its end.

    Args:
        objects: Positions of the objects.
        task: Goal and failure probabilities.
        work: Work space; ``first`` and ``actions`` are written.

    Returns:
        Fewest moves, and expected attempts of the plan; -1 and 0 where the goal cannot be met.
    """
    p = work.paths
    size = lay_out_task(objects, task, work)
    if size == 0:
        return NONE, 0.0
    mark_first(objects.clutter, p, work.first)
    fewest = p.table[state_number(p)]
    copy_objects(objects, work.now)
    attempts, count = 0.0, 0
    while count < len(work.actions):
        action = next_action(size, task, work)
        work.actions[count] = action
        if action < 0:
            break
        attempts += _attempts(action, task)
        _apply_action(action, work.now, task, work)
        count += 1
    return fewest, attempts


@kernel(nogil=True)
def plan_by_rules(objects: Objects, task: Task, work: PlannerWork) -> tuple[int, float]:
    """Plan one state by the rules alone: same number of moves, possibly more attempts.

    Args:
        objects: Positions of the objects.
        task: Goal and failure probabilities.
        work: Work space of the shape.

    Returns:
        Fewest moves, and expected attempts of the plan; -1 and 0 where the goal cannot be met.
    """
    p = work.paths
    if lay_out_task(objects, task, work) == 0:
        return NONE, 0.0
    copy_objects(objects, work.now)
    action = _choose(work.now, task, p)
    fewest = p.table[state_number(p)]
    return fewest, _try(action, np.inf, task, work) if action >= 0 else 0.0
