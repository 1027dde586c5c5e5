import asyncio
import stat
import threading
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from app.errors import InvalidInput
from app.live import commands
from app.live.people import work_loop
from app.live.snapshot import MAX_REFUSED
from app.live.sorting import commands as commands_of_sorting
from app.sim.cells.cell import load_cell
from app.sim.human import model as human
from app.sim.pick.task_policy import Decision
from tests.support.listening_ports import listening_ports
from tests.support.straight_policy import StraightPolicy
from tests.support.waiting import wait_until
from tests.web.viewer_client import ViewerClient
from web.viewer import loop
from web.viewer.loop import LiveCell
from web.viewer.scene.cell_scene import CellScene
from web.viewer.server import ViewerServer, _LoopEvent
from web.viewer.view_settings import PREFIX, RISK_MAP, ViewSettings


@pytest.fixture(scope="module")
def live() -> Iterator[LiveCell]:
    cell = load_cell()
    live = LiveCell(cell, StraightPolicy(cell), seed=2)
    live.start()
    yield live
    live.stop()


def test_world_ticks_without_any_client(live: LiveCell) -> None:
    first = live.handle.snapshot()
    wait_until(lambda: live.handle.snapshot().tick >= first.tick + 20)
    assert live.handle.snapshot().t_s > first.t_s


def test_simulated_time_never_runs_ahead_of_the_clock(live: LiveCell) -> None:
    start, first = time.monotonic(), live.handle.snapshot().tick
    wait_until(lambda: live.handle.snapshot().tick >= first + 15)
    elapsed = time.monotonic() - start
    ticks = live.handle.snapshot().tick - first
    assert ticks * 0.05 <= elapsed + 0.3


def test_viewer_opens_no_port_but_a_socket_of_its_user(live: LiveCell) -> None:
    before = listening_ports()
    other = LiveCell(load_cell(), None)
    other.start()
    assert listening_ports() == before
    for one in (live, other):
        assert stat.S_ISSOCK(one.viewer_address.stat().st_mode)
        assert stat.S_IMODE(one.viewer_address.parent.stat().st_mode) == 0o700
    assert live.viewer_address != other.viewer_address
    other.stop()


def test_commands_are_carried_out_in_order(live: LiveCell) -> None:
    live.handle.submit(commands.SetCandidates(ids=("cube1",)))
    live.handle.submit(commands.ToggleCandidate(id="cube2"))
    live.handle.submit(commands.ToggleCandidate(id="cube1"))
    wait_until(lambda: live.handle.snapshot().selected == ("cube2",))


def test_snapshot_says_which_commands_it_shows(live: LiveCell) -> None:
    live.handle.submit(commands.PauseClock())
    numbers = [live.handle.submit(commands.ToggleCandidate(id="cube3")) for _ in range(3)]
    assert numbers == list(range(numbers[0], numbers[0] + 3))
    before = live.handle.snapshot().selected
    wait_until(lambda: live.handle.snapshot().commands >= numbers[-1])
    assert ("cube3" in live.handle.snapshot().selected) != ("cube3" in before)
    with pytest.raises(InvalidInput):
        live.handle.submit(commands.RemovePerson(person=3))
    assert live.handle.submit(commands.ResumeClock()) == numbers[-1] + 1
    wait_until(lambda: live.handle.snapshot().commands == numbers[-1] + 1)
    assert live.handle.snapshot().refused == ()


def refused_of(*places: str) -> list[tuple[int, str]]:
    """Add a block at each place of an empty table in one tick; return what was refused."""
    live = LiveCell(load_cell("sorting-e0"), None)
    first = live.handle.snapshot().sorting
    assert first is not None
    for one in first.blocks:
        live.handle.submit(commands_of_sorting.RemoveBlock(id=one.id))
    cleared = live.handle.submit(commands.ResumeClock())
    for place in places:
        block = commands_of_sorting.AddBlock(colour="red", size="large", at=place)
        live.handle.submit(block)
    live.start()
    wait_until(lambda: live.handle.snapshot().commands == cleared + len(places))
    live.stop()
    found = live.handle.snapshot().refused
    return [(one.number - cleared, one.reason) for one in found]


def test_each_command_that_fits_no_more_when_its_turn_comes_is_named() -> None:
    (second, taken), (fourth, also_taken) = refused_of("slot5", "slot5", "slot6", "slot6")
    assert (second, fourth) == (2, 4)
    assert "slot5" in taken and "slot6" in also_taken


def test_newest_refused_commands_are_kept() -> None:
    found = refused_of(*["slot5"] * (MAX_REFUSED + 3))
    assert [number for number, _ in found] == list(range(4, MAX_REFUSED + 4))


def test_bad_commands_are_refused_at_the_door(live: LiveCell) -> None:
    with pytest.raises(InvalidInput, match="cube9"):
        live.handle.submit(commands.ToggleCandidate(id="cube9"))
    with pytest.raises(InvalidInput, match="person"):
        live.handle.submit(commands.SetAnthropometry(person=3, stature=40.0))


def test_person_can_be_changed_as_soon_as_it_was_added(live: LiveCell) -> None:
    live.handle.submit(commands.AddPerson())
    live.handle.submit(commands.SetAnthropometry(person=1, stature=90.0))
    wait_until(lambda: live.handle.snapshot().people[-1].anthropometry.stature == 90.0)
    live.handle.submit(commands.RemovePerson(person=1))
    with pytest.raises(InvalidInput, match="no person"):
        live.handle.submit(commands.SetMode(person=1, mode="still"))
    wait_until(lambda: len(live.handle.snapshot().people) == 1)


def test_click_on_a_cube_toggles_it_as_candidate(live: LiveCell) -> None:
    live.handle.submit(commands.SetCandidates(ids=("cube0",)))
    wait_until(lambda: live.handle.snapshot().selected == ("cube0",))
    with ViewerClient(live.viewer_address) as visitor:
        visitor.click("/stations/cube3")
        wait_until(lambda: live.handle.snapshot().selected == ("cube0", "cube3"))
        visitor.click("/stations/cube0")
        wait_until(lambda: live.handle.snapshot().selected == ("cube3",))


def test_drag_of_a_hand_moves_the_person(live: LiveCell) -> None:
    live.handle.submit(commands.SetMode(mode="manual"))
    live.handle.submit(commands.MovePerson(pelvis=(0.0, 1.3, -1.5708)))
    wait_until(lambda: abs(live.handle.snapshot().people[0].q[1] - 1.3) < 0.02)

    def away() -> float:
        person = live.handle.snapshot().people[0]
        palm = human.joint_points(person.q, person.size)["hand_r"]
        return float(np.linalg.norm(palm - [-0.15, 0.9, 0.25]))

    with ViewerClient(live.viewer_address) as visitor:
        visitor.drag("/gizmos/0/right", [(-0.1, 0.95, 0.3), (-0.15, 0.9, 0.25)])
        wait_until(lambda: away() < 0.03)


def test_drag_beyond_the_hall_takes_the_person_as_far_as_it_may_walk(live: LiveCell) -> None:
    live.handle.submit(commands.SetMode(mode="manual"))
    live.handle.submit(commands.MovePerson(pelvis=(0.0, 1.3, -1.5708)))
    farthest = live.cell.human.y_max
    with ViewerClient(live.viewer_address) as visitor:
        visitor.drag("/gizmos/0/pelvis", [(0.0, 1e4, 0.9)])
        wait_until(lambda: live.handle.snapshot().people[0].q[1] > farthest)


def test_drag_of_a_person_who_leaves_meanwhile_is_no_error(
    live: LiveCell, capsys: pytest.CaptureFixture[str]
) -> None:
    live.handle.submit(commands.AddPerson())
    live.handle.submit(commands.SetMode(person=1, mode="manual"))
    wait_until(lambda: len(live.handle.snapshot().people) == 2)
    server = live._server
    assert server is not None
    with ViewerClient(live.viewer_address) as visitor:
        visitor.wait_for("TransformControlsMessage", "/gizmos/1/pelvis")
        visitor.send(
            type="TransformControlsDragStartMessage", name="/gizmos/1/pelvis", owner=""
        )
        visitor.wait_until_heard(server)
        live.handle.submit(commands.RemovePerson(person=1))
        visitor.drag("/gizmos/1/pelvis", [(0.0, 1.5, 0.9)])
        visitor.wait_until_heard(server)
    wait_until(lambda: len(live.handle.snapshot().people) == 1)
    assert capsys.readouterr().err == ""  # viser prints what callbacks raise


class FailingPolicy(StraightPolicy):
    """Fails as soon as there is a person but the first one."""

    def decide(self, q: Any, qd: Any, people: Any, *state: Any, **terms: Any) -> Decision:
        if len(people) > 1:
            raise RuntimeError("two people")
        return super().decide(q, qd, people, *state, **terms)


def test_command_that_fails_is_named_and_the_next_ones_are_carried_out() -> None:
    cell = load_cell()
    live = LiveCell(cell, FailingPolicy(cell))
    number = live.handle.submit(commands.AddPerson())
    live.handle.submit(commands.RemovePerson(person=1))
    last = live.handle.submit(commands.SetMode(mode="still"))
    live.start()
    wait_until(lambda: live.handle.snapshot().commands == last)
    now = live.handle.snapshot()
    live.stop()
    [refused] = now.refused
    assert (refused.number, refused.reason) == (number, "add-person failed: two people")
    assert (len(now.people), now.mode) == (1, "still")


def test_world_goes_on_and_can_be_stopped_while_work_of_people_is_built(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    live, begun, may_end = LiveCell(load_cell(), None), threading.Event(), threading.Event()
    build = work_loop.people_of

    def slow(*of: Any) -> Any:
        begun.set()
        may_end.wait()
        return build(*of)

    monkeypatch.setattr(work_loop, "people_of", slow)
    live.start()
    try:
        live.handle.submit(commands.AddPerson())
        last = live.handle.submit(commands.SetAnthropometry(person=1, stature=95.0))
        wait_until(begun.is_set)
        tick = live.handle.snapshot().tick
        wait_until(lambda: live.handle.snapshot().tick >= tick + 20)
        assert live.handle.snapshot().commands == last
        live.stop()
    finally:
        may_end.set()
    assert [one.id for one in live.handle.snapshot().people] == [0, 1]


def test_nothing_is_drawn_without_a_viewer_but_the_first_one_sees_the_present() -> None:
    live = LiveCell(load_cell(), None)
    live.start()
    server = live._server
    assert server is not None
    wait_until(lambda: not server.is_current.is_set())
    drawn = server._websock_server.get_message_buffer().message_counter
    live.handle.submit(commands.AddPerson())
    wait_until(lambda: len(live.handle.snapshot().people) == 2)
    tick = live.handle.snapshot().tick
    wait_until(lambda: live.handle.snapshot().tick >= tick + 10)
    assert server._websock_server.get_message_buffer().message_counter == drawn
    with ViewerClient(live.viewer_address) as visitor:
        wait_until(lambda: bool(visitor.heard("ReplayDoneMessage")))
        types = [one["type"] for one in visitor.received]
        at_first = visitor.received[: types.index("ReplayDoneMessage")]
        assert "/gizmos/1" in {one.get("name") for one in at_first}
    wait_until(lambda: not server.has_viewers)
    live.stop()


def test_scene_that_cannot_be_drawn_does_not_delay_the_world(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    live = LiveCell(load_cell(), None)

    def fail(*_: object, **__: object) -> None:
        raise ValueError("a gizmo of another shape")

    monkeypatch.setattr(loop, "FAULT_LOG_S", 1e9)
    monkeypatch.setattr(loop, "ERROR_PAUSE_S", 1e5)  # would stop the world
    live.start()
    monkeypatch.setattr(CellScene, "draw", fail)
    with ViewerClient(live.viewer_address):
        wait_until(lambda: "could not be drawn" in caplog.text)
        tick = live.handle.snapshot().tick
        wait_until(lambda: live.handle.snapshot().tick >= tick + 60)
    live.stop()
    assert caplog.text.count("could not be drawn") == 1


def test_event_of_the_viewer_is_set_from_any_thread() -> None:
    async def waited() -> bool:
        event = _LoopEvent(asyncio.get_running_loop())
        waiter = asyncio.create_task(event.wait())
        await asyncio.sleep(0)
        await asyncio.to_thread(event.set)
        assert event.is_set() and not waiter.done()
        event.set()
        return await waiter

    assert asyncio.run(waited())


def test_stop_ends_thread_and_viewer() -> None:
    cell = load_cell()
    live = LiveCell(cell, None)
    live.start()
    address = live.viewer_address
    live.stop()
    live.stop()
    tick = live.handle.snapshot().tick
    assert not address.parent.exists()
    assert live.handle.snapshot().tick == tick


def test_faster_clock_takes_so_many_steps_between_two_pictures(live: LiveCell) -> None:
    live.handle.submit(commands.SetSpeed(factor=4))
    wait_until(lambda: live.handle.snapshot().speed == 4)
    first = live.handle.snapshot().tick
    seen = set[int]()

    def look() -> bool:
        seen.add(live.handle.snapshot().tick)
        return len(seen) >= 5

    wait_until(look)
    live.handle.submit(commands.SetSpeed(factor=1))
    wait_until(lambda: live.handle.snapshot().speed == 1)
    assert {(tick - first) % 4 for tick in seen} == {0}


@pytest.mark.parametrize("name", ["pick-and-place", "shared-workspace"])
def test_dragged_person_is_as_fast_at_any_speed_of_the_clock_while_it_is_paused(
    name: str,
) -> None:
    places = []
    for factor in (1, 8):
        live = LiveCell(load_cell(name), None)
        live.handle.submit(commands.SetSpeed(factor=factor))
        live.handle.submit(commands.PauseClock())
        live.handle.submit(commands.MovePerson(pelvis=(0.5, 2.0, 0.0)))
        before = live.handle.snapshot().people[0].q
        for _ in range(2):
            live._tick(lambda _: None, live.cell.robot.dt)
        places.append(live.handle.snapshot().people[0].q)
    assert not np.array_equal(places[0], before)
    assert np.array_equal(places[0], places[1])


def test_risk_map_that_was_hidden_is_not_shown_again(server: ViewerServer) -> None:
    cell = load_cell()
    live, views = LiveCell(cell, StraightPolicy(cell)), ViewSettings(server, cell)
    box = f"{PREFIX}{RISK_MAP.label}"
    with ViewerClient(server.address) as visitor:
        wait_until(
            lambda: (
                box in {one["props"]["label"] for one in visitor.heard("GuiCheckboxMessage")}
            )
        )
        visitor.check(box, value=True)
        wait_until(lambda: live._risk_map(views) is not None)
        visitor.check(box, value=False)
        wait_until(lambda: live._risk_map(views) is None)
        visitor.check(box, value=True)
        wait_until(lambda: views.is_seen(RISK_MAP))
        assert live._risk_map(views) is None
    live.stop()
