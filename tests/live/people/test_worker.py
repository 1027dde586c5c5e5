"""Work that is built in another thread: nobody but the person waits for it."""

from collections.abc import Callable
from concurrent.futures import Executor, Future
from functools import partial
from typing import Any, TypeVar

import numpy as np
import pytest

from app.live import commands
from app.live.people.workers import place_of
from app.live.pick.world import LivePickWorld
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.human.anthropometry import BodySize, percentile_body
from app.sim.human.model import rest_posture
from tests.live.pick.pick_scenes import run
from tests.support.straight_policy import StraightPolicy

T = TypeVar("T")


class Waiting(Executor):
    """Does nothing before ``finish`` is called."""

    def __init__(self) -> None:
        self._tasks: list[tuple[Future[Any], Callable[[], Any]]] = []

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        future = Future[T]()
        self._tasks.append((future, partial(fn, *args, **kwargs)))
        return future

    def finish(self) -> list[tuple[Cell, int, BodySize | None, int]]:
        """Do what was asked for and not cancelled; return what the work loops are made of."""
        built = []
        for future, call in self._tasks:
            if future.set_running_or_notify_cancel():
                future.set_result(call())
                built.append(future.result().arguments)
        self._tasks = []
        return built


@pytest.fixture
def executor() -> Waiting:
    return Waiting()


@pytest.fixture
def world(cell: Cell, executor: Waiting) -> LivePickWorld:
    world = LivePickWorld(cell, StraightPolicy(cell), seed=3)
    world.people.executor = executor
    return world


def rest(cell: Cell, index: int, count: int) -> Vec:
    """Return the posture of one person of ``count`` who rests at home."""
    return rest_posture(*place_of(cell, index, count).human.home)


def test_people_rest_at_home_until_their_work_is_built(
    world: LivePickWorld, executor: Waiting, cell: Cell
) -> None:
    world.apply(commands.AddPerson())
    last = run(world, 1).people
    for step in range(400):
        if step == 200:
            assert [np.allclose(one.q, rest(cell, one.id, 2)) for one in last] == [True, True]
            executor.finish()
        now = run(world, 1).people
        assert all(np.abs(a.q - b.q).max() < 0.5 for a, b in zip(now, last, strict=True))
        last = now
    assert not any(np.allclose(one.q, rest(cell, one.id, 2), atol=0.1) for one in last)


def test_only_work_of_the_last_size_and_place_is_built(
    world: LivePickWorld, executor: Waiting, cell: Cell
) -> None:
    for stature in (95.0, 5.0):
        world.apply(commands.SetAnthropometry(stature=stature))
        run(world, 12)
    for _ in range(2):
        world.apply(commands.AddPerson())
    built = {place.human.home: size for place, _, size, _ in executor.finish()}
    homes = [place_of(cell, index, 3).human.home for index in range(3)]
    sizes = [percentile_body(stature) for stature in (5.0, 50.0, 50.0)]
    assert built == dict(zip(homes, sizes, strict=True))


def test_reset_returns_people_to_their_work_as_far_as_it_is_built(
    world: LivePickWorld, executor: Waiting, cell: Cell
) -> None:
    first = world.snapshot().people[0].q
    run(world, 40)
    world.apply(commands.Reset())
    assert np.array_equal(world.snapshot().people[0].q, first)
    world.apply(commands.AddPerson())
    world.apply(commands.Reset())
    for one in world.snapshot().people:
        assert np.array_equal(one.q, rest(cell, one.id, 2))
    executor.finish()
    world.apply(commands.Reset())
    assert not any(one.joining for one in world.snapshot().people)


def test_person_who_does_something_else_is_not_called_back_to_work(
    world: LivePickWorld, executor: Waiting, cell: Cell
) -> None:
    world.apply(commands.AddPerson())
    world.apply(commands.MovePerson(person=1, pelvis=(0.5, 1.5, -1.57)))
    executor.finish()
    dragged = run(world, 100).people[1]
    assert dragged.mode == "manual"
    assert dragged.q[:2] == pytest.approx((0.5, 1.5), abs=0.02)

    alone = LivePickWorld(cell, StraightPolicy(cell), seed=3)
    world.apply(commands.AddPerson())
    for one in (world, alone):
        one.apply(commands.StartCase(id="case-1"))
    executor.finish()
    for one in (world, alone):
        run(one, 20)
    assert np.array_equal(world.snapshot().people[0].q, alone.snapshot().people[0].q)
