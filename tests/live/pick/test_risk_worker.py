"""Risk maps of a live cell: computed beside the loop, one at a time."""

import threading
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from app.live import commands
from app.live.pick import risk_worker
from app.live.pick.risk_worker import GRID, PersonRisk, RiskQuery, RiskWorker
from app.live.pick.world import LivePickWorld
from app.sim.cells.cell import load_cell
from app.sim.pick.task_policy import MovedPerson, RiskMap
from tests.support.straight_policy import StraightPolicy

WAIT_S = 30.0


def finished(worker: RiskWorker, query: Callable[[], RiskQuery | None]) -> PersonRisk:
    end = time.monotonic() + WAIT_S
    while worker.newest is None:
        assert time.monotonic() < end
        worker.offer(query)
        time.sleep(0.01)
    return worker.newest


def test_map_is_the_policys_for_the_state_of_the_world() -> None:
    cell = load_cell()
    world = LivePickWorld(cell, StraightPolicy(cell), seed=3)
    query = world.risk_query()
    assert query is not None
    person = query.people[0]
    found, middle = query.answer().map, GRID.shape[1] // 2
    assert found.chosen.shape == (len(GRID.x) * len(GRID.y),)
    posture = person.q.copy()
    posture[:2] = GRID.x[middle], GRID.y[0]
    moved = MovedPerson(index=0, q=posture[None])
    alone = query.policy.risk_map(
        query.q, query.qd, query.people, query.offered, moved, terms=query.terms
    )
    assert found.value[middle] == alone.value[0]
    world.step()
    assert not np.shares_memory(query.q, world.robot.q)


def test_one_map_is_computed_at_a_time() -> None:
    cell, go, began = load_cell(), threading.Event(), []

    class Slow(StraightPolicy):
        def risk_map(self, *state: object, **terms: object) -> RiskMap:
            began.append(threading.current_thread().name)
            assert go.wait(WAIT_S)
            return super().risk_map(*state, **terms)  # type: ignore[arg-type]

    world, worker = LivePickWorld(cell, Slow(cell), seed=3), RiskWorker()
    asked: list[RiskQuery | None] = []

    def query() -> RiskQuery | None:
        asked.append(world.risk_query())
        return asked[-1]

    for _ in range(3):
        worker.offer(query)
    assert len(asked) == 1 and worker.newest is None
    go.set()
    assert len(finished(worker, query).map.value) == len(GRID.x) * len(GRID.y)
    worker.close()
    assert began == [name for name in began if name.startswith("risk-map")]


def test_failed_map_does_not_hinder_the_next_one() -> None:
    cell = load_cell()
    world, worker = LivePickWorld(cell, StraightPolicy(cell), seed=3), RiskWorker()
    query = world.risk_query()
    assert query is not None
    worker.offer(lambda: replace(query, people=()))  # without a person to move
    with pytest.raises(IndexError):
        finished(worker, lambda: query)
    assert finished(worker, lambda: query).map.value.shape == (len(GRID.x) * len(GRID.y),)
    worker.close()


def test_map_names_the_person_that_it_moves() -> None:
    cell = load_cell()
    world = LivePickWorld(cell, StraightPolicy(cell), seed=3)
    world.apply(commands.AddPerson())
    world.apply(commands.RemovePerson(person=0))
    query = world.risk_query()
    assert query is not None
    assert query.answer().person == 1
    np.testing.assert_array_equal(query.people[0].q, world.snapshot().people[0].q)


def test_forgotten_map_is_not_returned_even_if_it_was_being_computed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(risk_worker, "INTERVAL_S", 1e9)  # no other map follows
    cell, go = load_cell(), threading.Event()

    class Slow(StraightPolicy):
        def risk_map(self, *state: object, **terms: object) -> RiskMap:
            assert go.wait(WAIT_S)
            return super().risk_map(*state, **terms)  # type: ignore[arg-type]

    world, worker = LivePickWorld(cell, Slow(cell), seed=3), RiskWorker()
    worker.offer(world.risk_query)
    worker.forget()
    go.set()
    worker._pool.shutdown()  # the map is finished
    worker.offer(world.risk_query)
    assert worker.newest is None


def test_without_a_policy_or_a_person_there_is_no_map() -> None:
    cell = load_cell()
    assert LivePickWorld(cell, None, seed=3).risk_query() is None
    world = LivePickWorld(cell, StraightPolicy(cell), seed=3)
    world.apply(commands.RemovePerson(person=0))
    assert world.risk_query() is None
