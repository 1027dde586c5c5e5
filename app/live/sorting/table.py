"""Blocks and goal of a live sorting cell, and changes by robot and people.

Blocks have constant ids; :attr:`SortingTable.state` has no ids, like the observation of the
sorting policy. A held block counts at its former place or, if that is occupied, at the first
free clutter slot. One is always free, since there are at most as many blocks as slots.

Source: docs/method.md 1.1 and 1.2.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from app.errors import InvalidInput
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.sorting.batch import fail_of
from app.sim.sorting.benchmark_tasks import sorted_goal
from app.sim.sorting.names import names_of
from app.sim.sorting.state import NULL, Codes, SortingState, missing


@dataclass(frozen=True, slots=True)
class Block:
    """One block."""

    id: str
    """Name, never reused."""
    code: int
    """Code of colour and size, see ``state.py``."""


class SortingTable:
    """Blocks by place, and the goal."""

    def __init__(self, cell: Cell) -> None:
        self.cell = cell
        """Work cell."""
        self.names = names_of(cell)
        """Names of stations, colours and sizes."""
        self.shape = self.names.shape
        """Size of the task."""
        self.fail = fail_of(cell)
        """Failure probability of each clutter slot, shape (K,)."""
        self.clutter: list[Block | None] = [None] * self.shape.n_slots
        self.towers: list[list[Block]] = [[] for _ in range(self.shape.n_colours)]
        self.goal = np.zeros((self.shape.n_colours, self.shape.n_slots), dtype=np.int8)
        self.held: Block | None = None
        """Held block."""
        self.version = 0
        """Number of changes by people."""
        self._origin = 0
        self._next = 1
        self._goal_ids: tuple[str, ...] = ()

    # State.

    @property
    def blocks(self) -> tuple[Block, ...]:
        """All blocks, the held one included, in the order of their ids."""
        found = [one for one in self.clutter if one is not None]
        found += [one for tower in self.towers for one in tower]
        found += [self.held] if self.held is not None else []
        return tuple(sorted(found, key=lambda one: int(one.id.removeprefix("block"))))

    @property
    def goal_ids(self) -> frozenset[str]:
        """Ids of the blocks assigned to the goal."""
        return frozenset(self._goal_ids)

    @property
    def held_position(self) -> int:
        """Position at which the held block counts in the state."""
        k = self.shape.n_slots
        if self._origin >= k or self.clutter[self._origin] is None:
            return self._origin
        return next(i for i in range(k) if self.clutter[i] is None)

    @property
    def state(self) -> SortingState:
        """The task as observed by the sorting policy."""
        clutter = np.array([one.code if one else NULL for one in self.clutter], dtype=np.int8)
        towers = np.zeros_like(self.goal)
        for c, tower in enumerate(self.towers):
            towers[c, : len(tower)] = [one.code for one in tower]
        if self.held is not None and self.held_position < len(clutter):
            clutter[self.held_position] = self.held.code
        elif self.held is not None:
            c = self.held_position - len(clutter)
            towers[c, len(self.towers[c])] = self.held.code
        return SortingState(
            clutter=clutter, towers=towers, goal=self.goal.copy(), fail=self.fail.copy()
        )

    def top(self, position: int) -> Block | None:
        """Return the topmost block at a position, or None."""
        k = self.shape.n_slots
        if position < k:
            return self.clutter[position]
        return self.towers[position - k][-1] if self.towers[position - k] else None

    def code(self, colour: str, size: str) -> int:
        """Return the code of a colour and a size of this cell."""
        return self.shape.code(self.names.colours.index(colour), self.names.sizes.index(size))

    def place_of(self, block: Block) -> tuple[int, int]:
        """Return position and level of a block that is not held."""
        for k, one in enumerate(self.clutter):
            if one == block:
                return k, 0
        for c, tower in enumerate(self.towers):
            if block in tower:
                return self.shape.n_slots + c, tower.index(block)
        raise InvalidInput("id", block.id, "is held by the gripper")

    def point(self, position: int, level: int) -> Vec:
        """Return the top centre of a block at a position and level [m], shape (3,)."""
        return np.asarray(self.cell.station(self.names.stations[position]).points()[level])

    def point_at(self, position: int) -> Vec:
        """Return the top centre of the next block at a position [m], shape (3,)."""
        k = self.shape.n_slots
        return self.point(position, 0 if position < k else len(self.towers[position - k]))

    def point_of(self, block: Block) -> Vec | None:
        """Return the top centre of a block [m], shape (3,); None if held or removed."""
        if block not in self.blocks or block == self.held:
            return None
        return self.point(*self.place_of(block))

    # Changes by the robot.

    def lift(self, position: int) -> None:
        """Grasp the topmost block of a position."""
        block = self.top(position)
        assert block is not None
        self._detach(block)
        self.held, self._origin = block, position

    def drop(self, position: int) -> None:
        """Place the held block at a position."""
        assert self.held is not None
        self._put(self.held, position)
        self.held = None
        self._assign_goal()

    # Changes by people. The words of a command are known: see ``command_checks.py``.

    def add(self, colour: str, size: str, at: str | None) -> None:
        """Add a block.

        Raises:
            InvalidInput: No free place, or as many blocks as clutter slots.
        """
        if len(self.blocks) >= self.shape.n_slots:
            rule = f"would be more than {self.shape.n_slots} blocks, one per clutter slot"
            raise InvalidInput("blocks", len(self.blocks) + 1, rule)
        position = self._free_cell() if at is None else self._free("at", at)
        self._put(self._new(self.code(colour, size)), position)
        self._changed()

    def remove(self, id: str) -> Block:
        """Remove a block, and goal blocks that no block matches any more.

        Raises:
            InvalidInput: There is no such block.
        """
        block = self._known(id)
        self._detach(block)
        self._shrink_goal()
        self._changed()
        return block

    def move(self, id: str, to: str) -> None:
        """Move a block, also one below others or a held one.

        Raises:
            InvalidInput: No such block, or the place is occupied.
        """
        block = self._known(id)
        position = self._free("to", to, block)
        self._detach(block)
        self._put(block, position)
        self._changed()

    def set_goal(self, towers: Mapping[str, Iterable[str]]) -> None:
        """Set the goal; towers that are not named are empty in it.

        Args:
            towers: Sizes from the bottom, by tower.

        Raises:
            InvalidInput: Too many levels, or blocks are missing.
        """
        goal = np.zeros_like(self.goal)
        for name, sizes in towers.items():
            c, wanted = self.names.towers.index(name), list(sizes)
            if len(wanted) > self.shape.n_slots:
                rule = f"must have at most {self.shape.n_slots} levels"
                raise InvalidInput(f"towers.{name}", len(wanted), rule)
            for level, size in enumerate(wanted):
                goal[c, level] = self.shape.code(c, self.names.sizes.index(size))
        self._require_matches(goal)
        self.goal, self._goal_ids = goal, ()
        self._changed()

    def toggle_goal(self, id: str) -> None:
        """Add a block, or one more of a kind, to the goal, or remove it.

        Raises:
            InvalidInput: There is no such block or kind, or no block of the kind.
        """
        code = self._kind(id)
        there = [one.id for one in self.blocks if one.code == code]
        if not there:
            raise InvalidInput("id", id, "is a kind of which there is no block")
        marked = [one for one in self._goal_ids if one in there]
        if id in there:
            now = [one for one in marked if one != id] + ([id] if id not in marked else [])
        else:
            more = [one for one in there if one not in marked][:1]
            now = marked + more if more else []
        others = [int(one) for one in self.goal.ravel() if one not in (NULL, code)]
        self.goal = sorted_goal([*others, *[code] * len(now)], self.shape)
        self._goal_ids = tuple(one for one in self._goal_ids if one not in there) + tuple(now)
        self._changed()

    def begin(self, state: SortingState) -> None:
        """Set a state with new blocks."""
        self.clutter = [None] * self.shape.n_slots
        self.towers = [[] for _ in range(self.shape.n_colours)]
        self.adopt(state)

    def adopt(self, state: SortingState) -> None:
        """Set a state; blocks that stay in place keep their ids."""
        for k, code in enumerate(state.clutter.tolist()):
            self.clutter[k] = self._kept(self.clutter[k], code)
        for c, codes in enumerate(state.towers.tolist()):
            old = [*self.towers[c], *[None] * len(codes)]
            kept = [self._kept(old[level], code) for level, code in enumerate(codes)]
            self.towers[c] = [one for one in kept if one is not None]
        self.held = None
        self.goal, self.fail = state.goal.copy(), state.fail.copy()
        self._changed()

    def show(self, block: Block, place: str | None) -> None:
        """Add a block of another table at a station; None: held."""
        if place is None:
            self.held = block
        else:
            self._put(block, self.names.stations.index(place))
        self._next = max(self._next, int(block.id.removeprefix("block")) + 1)

    # Helper functions.

    def _kept(self, block: Block | None, code: int) -> Block | None:
        if code == NULL:
            return None
        return block if block is not None and block.code == code else self._new(code)

    def _new(self, code: int) -> Block:
        block = Block(f"block{self._next}", code)
        self._next += 1
        return block

    def _put(self, block: Block, position: int) -> None:
        k = self.shape.n_slots
        if position >= k:
            self.towers[position - k].append(block)
        else:
            self.clutter[position] = block

    def _detach(self, block: Block) -> None:
        if block == self.held:
            self.held = None
            return
        position, _ = self.place_of(block)
        k = self.shape.n_slots
        if position >= k:
            self.towers[position - k].remove(block)
        else:
            self.clutter[position] = None

    def _known(self, id: str) -> Block:
        for one in self.blocks:
            if one.id == id:
                return one
        raise InvalidInput("id", id, "is not a block", [one.id for one in self.blocks])

    def _kind(self, id: str) -> int:
        colour, _, size = id.partition("-")
        if colour in self.names.colours and size in self.names.sizes:
            return self.code(colour, size)
        return self._known(id).code

    def _free_cell(self) -> int:
        taken = self.held_position if self.held is not None else None
        free = [k for k, one in enumerate(self.clutter) if one is None and k != taken]
        if not free:
            raise InvalidInput("at", None, "has no default: no clutter slot is free")
        return free[0]

    def _free(self, field: str, place: str, block: Block | None = None) -> int:
        position = self.names.stations.index(place)
        if position < self.shape.n_slots:
            there = self.clutter[position]
            if there is not None:
                own = there == block
                rule = "is where it is already" if own else f"is taken by {there.id}"
                free = zip(self.names.slots, self.clutter, strict=True)
                known = [*(name for name, one in free if one is None), *self.names.towers]
                raise InvalidInput(field, place, rule, known)
        elif self.top(position) == block and block is not None:
            raise InvalidInput(field, place, "is where it is already")
        return position

    def _require_matches(self, goal: Codes) -> None:
        lack = missing(replace(self.state, goal=goal), self.shape)
        if lack.any():
            words = [
                f"{lack[code]} x {self.names.kind(int(code))}" for code in np.flatnonzero(lack)
            ]
            rule = "must be met by the blocks: these are missing"
            raise InvalidInput("towers", ", ".join(words), rule)

    def _shrink_goal(self) -> None:
        """Remove goal blocks that no block matches, from the top."""
        lack = missing(self.state, self.shape)
        for code in np.repeat(np.arange(len(lack)), lack):
            c, level = (int(found[-1]) for found in np.nonzero(self.goal == code))
            self.goal[c, level:-1] = self.goal[c, level + 1 :]
            self.goal[c, -1] = NULL

    def _changed(self) -> None:
        self.version += 1
        self._assign_goal()

    def _assign_goal(self) -> None:
        """Assign blocks to the goal: those in place, those assigned before, then any."""
        counts = np.bincount(self.goal.ravel(), minlength=self.shape.n_types + 1)
        in_place = [
            one.id
            for c, tower in enumerate(self.towers)
            for level, one in enumerate(tower)
            if one.code == self.goal[c, level]
        ]
        codes = {one.id: one.code for one in self.blocks}
        wanted: list[str] = []
        for id in (*in_place, *self._goal_ids, *codes):
            if id in codes and id not in wanted and counts[codes[id]] > 0:
                counts[codes[id]] -= 1
                wanted.append(id)
        self._goal_ids = tuple(wanted)
