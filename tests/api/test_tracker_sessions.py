"""Sessions of trackers: bounded, forgotten when idle, each with its own people."""

import numpy as np
import pytest

from app.api.tracker_sessions import IDLE_S, MAX_SESSIONS, TrackerSessions
from app.errors import Conflict, InvalidInput, NotFound
from tests.sim.tracked_person import CELL, seen, work


class Clock:
    def __init__(self) -> None:
        self.t = 0.0

    def __call__(self) -> float:
        return self.t


def test_an_idle_session_ends_and_a_used_one_stays() -> None:
    clock = Clock()
    sessions = TrackerSessions(clock)
    idle, used = (sessions.open(CELL.name, 1, CELL.body) for _ in range(2))
    for _ in range(4):
        clock.t += 0.4 * IDLE_S
        sessions.get(used.id)
    assert sessions.all() == [used]
    with pytest.raises(NotFound):
        sessions.get(idle.id)


def test_there_is_room_for_so_many_and_again_after_one_is_closed() -> None:
    sessions = TrackerSessions(Clock())
    opened = [sessions.open(CELL.name, 1, CELL.body) for _ in range(MAX_SESSIONS)]
    with pytest.raises(Conflict, match="delete one"):
        sessions.open(CELL.name, 1, CELL.body)
    sessions.close(opened[0].id)
    sessions.open(CELL.name, 1, CELL.body)
    with pytest.raises(NotFound):
        sessions.close(opened[0].id)


def test_room_comes_back_when_sessions_are_idle() -> None:
    clock = Clock()
    sessions = TrackerSessions(clock)
    for _ in range(MAX_SESSIONS):
        sessions.open(CELL.name, 1, CELL.body)
    clock.t = IDLE_S + 1.0
    assert sessions.open(CELL.name, 1, CELL.body) and len(sessions.all()) == 1


def test_estimates_are_for_the_newest_frame_or_soon_after() -> None:
    session = TrackerSessions(Clock()).open(CELL.name, 1, CELL.body)
    with pytest.raises(InvalidInput, match="frame before"):
        session.estimates(None)
    session.take(5.0, [seen(work(1, 12.0)[1][0])], [np.ones(25)])
    assert session.estimates(None)[0] == 5.0 and session.estimates(5.2)[0] == 5.2
    for wrong in (4.9, 1e6):
        with pytest.raises(InvalidInput, match="after the newest"):
            session.estimates(wrong)
