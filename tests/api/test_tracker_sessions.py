"""Sessions of trackers: bounded, forgotten when idle, each with its own people."""

import time

import numpy as np
import pytest

from app.api.tracker_sessions import (
    IDLE_S,
    MAX_SESSIONS,
    TrackerSession,
    TrackerSessions,
    service_clock,
)
from app.errors import ClockJump, Conflict, InvalidInput, NotFound
from tests.sim.tracked_person import CELL, seen, work

DT = 1.0 / 30.0


class Clock:
    def __init__(self) -> None:
        self.t = 0.0

    def __call__(self) -> float:
        return self.t


def test_an_idle_session_ends_and_a_used_one_stays() -> None:
    clock = Clock()
    sessions = TrackerSessions(clock)
    idle, used = (sessions.open(CELL.name, 1, CELL.body, CELL.floor_z) for _ in range(2))
    for _ in range(4):
        clock.t += 0.4 * IDLE_S
        sessions.get(used.id)
    assert sessions.all() == [used]
    with pytest.raises(NotFound):
        sessions.get(idle.id)


def test_there_is_room_for_so_many_and_again_after_one_is_closed() -> None:
    sessions = TrackerSessions(Clock())
    opened = [sessions.open(CELL.name, 1, CELL.body, CELL.floor_z) for _ in range(MAX_SESSIONS)]
    with pytest.raises(Conflict, match="delete one"):
        sessions.open(CELL.name, 1, CELL.body, CELL.floor_z)
    sessions.close(opened[0].id)
    sessions.open(CELL.name, 1, CELL.body, CELL.floor_z)
    with pytest.raises(NotFound):
        sessions.close(opened[0].id)


def test_room_comes_back_when_sessions_are_idle() -> None:
    clock = Clock()
    sessions = TrackerSessions(clock)
    for _ in range(MAX_SESSIONS):
        sessions.open(CELL.name, 1, CELL.body, CELL.floor_z)
    clock.t = IDLE_S + 1.0
    assert sessions.open(CELL.name, 1, CELL.body, CELL.floor_z) and len(sessions.all()) == 1


def fed(clock: Clock, n_people: int = 1) -> TrackerSession:
    """A session after a second of frames at 30 Hz, stamped from 1000 s on."""
    session = TrackerSessions(clock).open(CELL.name, n_people, CELL.body, CELL.floor_z)
    for k, q in enumerate(work(1, 12.0)[1][:30]):
        session.take(1000.0 + k * DT, clock(), [seen(q)], [np.ones(25)])
        clock.t += DT
    clock.t -= DT
    return session


def test_ages_count_from_the_arrival_of_the_newest_frame() -> None:
    session = fed(clock := Clock())
    clock.t += 3.0
    known = session.people()
    assert known.t == pytest.approx(1000.0 + 29 * DT + 3.0)
    assert known.estimates[0].age_s == pytest.approx(3.0)
    assert known.observed_age_s[0] == pytest.approx(3.0)
    assert "stale" in known.estimates[0].flags


@pytest.mark.parametrize("t", [0.0, 1000.0, 1000.0 + 29 * DT, 1001.0, -1e10])
def test_a_time_from_the_caller_never_makes_people_younger(t: float) -> None:
    session = fed(clock := Clock())
    clock.t += 0.4
    assert session.people(t).estimates[0].age_s == pytest.approx(0.4)


@pytest.mark.parametrize("ahead", [0.5, 60.0, 1e9])
def test_a_later_time_from_the_caller_makes_people_older(ahead: float) -> None:
    session = fed(Clock())
    known = session.people(1000.0 + 29 * DT + ahead)
    assert known.estimates[0].age_s == pytest.approx(ahead)
    assert "stale" in known.estimates[0].flags


def test_people_are_stale_while_the_clock_is_out_of_step_and_fresh_again_after() -> None:
    session, person = fed(clock := Clock()), seen(work(1, 12.0)[1][30])
    for k in range(1, 6):
        clock.t += DT
        try:
            flags = (
                session.take(7.0 + k * DT, clock(), [person], [np.ones(25)]).estimates[0].flags
            )
        except ClockJump:
            assert k < 3
            assert {"clock-jump", "stale"} <= set(session.people().estimates[0].flags)
        else:
            assert k >= 3 and flags == (("clock-jump",) if k == 3 else ())
    assert session.people().estimates[0].flags == () and session.t == 7.0 + 5 * DT


def test_a_refused_frame_leaves_the_age_as_it_was() -> None:
    session = fed(clock := Clock())
    clock.t += 1.0
    with pytest.raises(InvalidInput):
        session.take(1000.0 + 30 * DT, clock(), [np.zeros((7, 3))], [np.ones(25)])
    assert session.people().estimates[0].age_s == pytest.approx(1.0)
    assert session.n_frames == 30


def test_absence_of_people_is_known_only_while_frames_arrive() -> None:
    session = fed(clock := Clock(), n_people=2)
    assert session.people().estimates[1].flags == ("never-seen",)
    clock.t += 1.0
    assert session.people().estimates[1].flags == ("never-seen", "stale")


def test_people_are_stale_before_the_first_frame() -> None:
    session = TrackerSessions(Clock()).open(CELL.name, 1, CELL.body, CELL.floor_z)
    known = session.people(5.0)
    assert known.t is None and known.observed == (None,)
    assert known.estimates[0].flags == ("never-seen", "stale")


def test_the_service_clock_counts_the_time_of_a_suspended_machine(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(time, "CLOCK_BOOTTIME", 7, raising=False)  # Linux only
    monkeypatch.setattr(time, "clock_gettime", {7: 77.0}.__getitem__)
    assert service_clock() == 77.0
