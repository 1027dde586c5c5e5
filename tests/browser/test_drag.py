"""A visitor drags the person into the robot's offset and sees the robot choose another goal."""

import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from app.policies.inference.task_selection import HYSTERESIS
from app.sim.cells.cell import load_cell
from app.sim.human import model as human
from tests.browser.conftest import LIMIT_S
from tests.browser.scene import drag_along
from tests.support import patient_http

pytestmark = pytest.mark.browser

CELL = load_cell()
START, GOALS = "cube2", {"cube1", "cube3"}
"""Where the robot has just picked, and the two neighbours it may go to next."""
GRIP_M = 0.12
"""Where along a gizmo's arrow the mouse takes it; the arrows of the hands are 0.2 m long."""
NEAR_M = 0.03
ROUNDS = 4


def tell(server: str, *commands: dict) -> None:
    """Send commands to the world."""
    for command in commands:
        answer = patient_http.post(f"{server}/v1/worlds/main/commands", json=command)
        assert answer.status_code == 202, answer.text


def state(server: str) -> dict:
    found: dict = patient_http.get(f"{server}/v1/worlds/main").json()
    return found


def hand(server: str, name: str) -> np.ndarray:
    """Return where a hand is, as the service says [m]."""
    q = np.array(state(server)["state"]["people"][0]["q"])
    return np.array(human.joint_points(q, CELL.body)[f"hand_{name[0]}"])


def shown_choice(page: Page) -> str | None:
    chosen = page.locator('[data-chosen="true"]')
    return chosen.get_attribute("data-candidate") if chosen.count() else None


def settle(page: Page, server: str) -> str:
    """Wait until person and choice are at rest and the page shows them; return the choice."""
    before: list[float] = []
    for _ in range(100):
        page.wait_for_timeout(500)
        now = state(server)
        q = now["state"]["people"][0]["q"]
        if (
            np.allclose(q, before or [np.inf], atol=1e-4)
            and shown_choice(page) == now["chosen"]
        ):
            return str(now["chosen"])
        before = q
    raise AssertionError("person and choice do not come to rest")


def pause_after_a_pick(server: str) -> None:
    """Let the robot pick one cube, and stop the clock when it may choose between two others."""
    tell(
        server,
        {"tag": "set-mode", "mode": "auto"},
        {"tag": "set-candidates", "ids": [START]},
        {"tag": "reset"},
        {"tag": "set-mode", "mode": "manual"},
        {"tag": "resume"},
    )
    until(server, lambda now: now["status"] == "picking")
    tell(server, {"tag": "pause"}, {"tag": "set-candidates", "ids": sorted(GOALS)})
    for _ in range(100):
        before = until(server, lambda now: now["paused"])
        if before["status"] == "moving" and len(before["candidates"]) == len(GOALS):
            return
        tell(server, {"tag": "step"})
        until(server, lambda now, tick=before["tick"]: now["tick"] > tick)
    raise AssertionError(f"the robot does not go on after its pick: {before['message']}")


def until(server: str, holds: Callable[[dict], bool]) -> dict:
    """Return the first state of the world for which ``holds`` is true."""
    end = time.monotonic() + LIMIT_S
    while time.monotonic() < end:
        now = state(server)
        if holds(now):
            return now
        time.sleep(0.05)
    raise AssertionError(f"the world did not get there: {now['status']}, {now['message']}")


@pytest.fixture
def resumed(server: str) -> Iterator[str]:
    """The server, whose world goes on with its first targets and person afterwards."""
    selected = state(server)["selected"]
    yield server
    tell(
        server,
        {"tag": "set-candidates", "ids": selected},
        {"tag": "set-mode", "mode": "auto"},
        {"tag": "resume"},
    )


def test_dragging_a_hand_onto_the_chosen_cube_changes_the_choice(
    open_page: Callable[..., Page], resumed: str
) -> None:
    server = resumed
    pause_after_a_pick(server)
    page = open_page()
    expect(page.locator(".story .chip").first).to_have_text("Paused")
    chosen = settle(page, server)
    target = np.array(CELL.station(chosen).position)
    name = "right" if target[0] < 0 else "left"
    for axis in (2, 1, 0) * ROUNDS:
        now = hand(server, name)
        if abs(target[axis] - now[axis]) > NEAR_M:
            offset = np.eye(3)[axis] * (target - now)
            drag_along(page, CELL, lambda: hand(server, name), offset, GRIP_M)
            other = settle(page, server)
            if other != chosen:
                break
    assert {other} == GOALS - {chosen}
    expect(page.locator(f'[data-candidate="{other}"]')).to_have_attribute("data-chosen", "true")
    asked = patient_http.post(f"{server}/v1/task-selection", json=state(server)["state"]).json()
    assert asked["chosen"] == other
    values = {c["id"]: c["value"] for c in asked["candidates"]}
    assert values[other] >= values[chosen] - HYSTERESIS
    assert page.problems == []  # type: ignore[attr-defined]
