"""Brute force on small sorting tasks: every state and move, by the rules of docs/method.md 1.2
alone.

Nothing here knows of towers' progress. A state is ``(clutter, towers)`` as tuples of codes.
"""

import heapq
import itertools
from collections.abc import Iterator

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.sorting.state import Move, SortingShape, SortingState

Key = tuple[tuple[int, ...], tuple[tuple[int, ...], ...]]
"""Objects in the slots, and on each tower without free levels."""


def key_of(state: SortingState) -> Key:
    """What a state holds."""
    towers = tuple(tuple(int(x) for x in t if x) for t in state.towers)
    return tuple(int(x) for x in state.clutter), towers


def goal_of(state: SortingState) -> tuple[tuple[int, ...], ...]:
    """What its towers shall hold."""
    return tuple(tuple(int(x) for x in t if x) for t in state.goal)


def moves_from(key: Key, shape: SortingShape) -> Iterator[tuple[int, Key]]:
    """Every move that changes something: its action, and what it leads to."""
    clutter, towers = key
    k, c = shape.n_slots, shape.n_colours
    for i, d in itertools.product(range(k), range(c)):
        if clutter[i] and len(towers[d]) < k:
            after = [*towers]
            after[d] = (*towers[d], clutter[i])
            yield i * c + d, ((*clutter[:i], 0, *clutter[i + 1 :]), tuple(after))
    for source in range(c):
        if not towers[source]:
            continue
        code, rest = towers[source][-1], towers[source][:-1]
        lifted = (*towers[:source], rest, *towers[source + 1 :])
        for i in range(k):
            if not clutter[i]:
                slots = (*clutter[:i], code, *clutter[i + 1 :])
                yield k * c + source * k + i, (slots, lifted)
        for d in range(c):
            if d != source and len(lifted[d]) < k:
                after = [*lifted]
                after[d] = (*lifted[d], code)
                yield 2 * k * c + source * c + d, (clutter, tuple(after))


def _least(key: Key) -> Key:
    """The state with its clutter sorted: which cell holds what does not change fewest moves."""
    return tuple(sorted(key[0])), key[1]


def moves_to_go(state: SortingState, shape: SortingShape) -> tuple[int, dict[Key, int]]:
    """Fewest moves to the goal, and of every state met on the way, by breadth-first search.

    The search runs backwards from the goal until the state is met; moves can be taken back, so
    distances are the same both ways. Keys have their clutter sorted.
    """
    goal, counts = goal_of(state), sorted(int(x) for x in state.clutter if x)
    for tower in key_of(state)[1]:
        counts += tower
    for x in itertools.chain(*goal):
        counts.remove(x)
    free = [0] * (shape.n_slots - len(counts))
    start = _least((tuple(free + counts), goal))
    target = _least(key_of(state))
    distance, wave = {start: 0}, [start]
    while wave and not (target in distance and distance[wave[0]] > distance[target]):
        following = []
        for key in wave:
            for _, other in moves_from(key, shape):
                after = _least(other)
                if after not in distance:
                    distance[after] = distance[key] + 1
                    following.append(after)
        wave = following
    return distance[target], distance


def first_moves(state: SortingState, shape: SortingShape) -> tuple[int, tuple[int, ...]]:
    """Fewest moves, and every action with which such a plan begins."""
    fewest, distance = moves_to_go(state, shape)
    first = [
        action
        for action, after in moves_from(key_of(state), shape)
        if distance.get(_least(after), fewest) == fewest - 1
    ]
    return fewest, tuple(sorted(first)) if fewest else ()


def fewest_attempts(
    state: SortingState, shape: SortingShape, to_go: dict[Key, int], fewest_moves: bool = True
) -> float:
    """Fewest expected attempts to the goal, a shortest path by A*.

    A failed pick changes nothing, so a pick from cell k is an edge of length ``1 / (1 -
    fail[k])``, and moves to go are a lower bound of attempts to go.

    Args:
        state: Where it starts.
        shape: Its shape.
        to_go: Fewest moves of states, by ``moves_to_go``.
        fewest_moves: Look only at plans with the fewest moves.
    """
    goal, moves = goal_of(state), shape.n_slots * shape.n_colours
    cost = 1.0 / (1.0 - state.fail)
    far = max(to_go.values()) + 1
    best, done = {key_of(state): 0.0}, set()
    line = [(0.0, key_of(state))]
    while line:
        _, key = heapq.heappop(line)
        if key in done:
            continue
        if key[1] == goal:
            return best[key]
        done.add(key)
        here = to_go.get(_least(key), far)
        for action, after in moves_from(key, shape):
            there = to_go.get(_least(after), far)
            if fewest_moves and there != here - 1:
                continue
            spent = best[key] + (cost[action // shape.n_colours] if action < moves else 1.0)
            if spent < best.get(after, np.inf):
                best[after] = float(spent)
                heapq.heappush(line, (float(spent) + there, after))
    raise AssertionError("no plan")


def random_task(
    shape: SortingShape, rng: np.random.Generator, n_objects: int, on_towers: float = 0.5
) -> SortingState:
    """A task with objects anywhere and a goal of any of them, towers of any colours.

    Args:
        shape: Its shape.
        rng: Randomness.
        n_objects: Objects.
        on_towers: Share of them that stand on towers.
    """
    k, c = shape.n_slots, shape.n_colours
    codes = rng.integers(1, shape.n_types + 1, n_objects)
    clutter, towers, goal = np.zeros(k), np.zeros((c, k)), np.zeros((c, k))
    stacks: list[list[int]] = [[] for _ in range(c)]
    wanted: list[list[int]] = [[] for _ in range(c)]
    cells = rng.permutation(k)
    for i, code in enumerate(codes):
        if rng.random() < on_towers:
            stacks[rng.integers(c)].append(code)
        else:
            clutter[cells[i]] = code
    for code in rng.permutation(codes)[: rng.integers(n_objects + 1)]:
        wanted[rng.integers(c)].append(code)
    for d in range(c):
        towers[d, : len(stacks[d])] = stacks[d]
        goal[d, : len(wanted[d])] = wanted[d]
    return SortingState(
        clutter=clutter.astype(np.int8),
        towers=towers.astype(np.int8),
        goal=goal.astype(np.int8),
        fail=rng.uniform(0.0, 0.4, k),
    )


def attempts_of(moves: list[Move], fail: Vec) -> float:
    """Return the expected attempts of a plan.

    Args:
        moves: The plan.
        fail: Failure probabilities of the clutter slots, shape (K,); other picks do not fail.
    """
    risks = [fail[move.pick] if move.pick < len(fail) else 0.0 for move in moves]
    return float(sum(1.0 / (1.0 - risk) for risk in risks))
