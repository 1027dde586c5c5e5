"""A visitor drags the person into the robot's way and sees the robot choose another goal."""

from collections.abc import Callable

import httpx
import numpy as np
import pytest
import viser
from playwright.sync_api import Page, expect

from app.sim import human
from app.sim.cells import load_cell
from tests.browser.camera import Camera
from web import workplace

pytestmark = pytest.mark.browser

CELL = load_cell()
GOALS = {"cube1": "right", "cube4": "left"}
"""The goals on offer, and the hand that is nearer to each."""
GRIP_M = 0.12
"""Where along a gizmo's arrow the mouse takes it; the arrows of the hands are 0.2 m long."""
TRIES = 12
SMALL = (1024, 700)
"""A window whose scene software draws a few times per second."""
MOVES = 10


def first_camera(page: Page, port: int) -> Camera:
    """Return the camera a visitor starts with, on the canvas of this page."""
    server = viser.ViserServer(host="127.0.0.1", port=port, verbose=False)
    workplace.build(server, CELL)
    first = server.initial_camera
    position, look_at, fov = tuple(first.position), tuple(first.look_at), float(first.fov)
    server.stop()
    canvas = page.frame_locator('[data-role="viewer"]').locator("canvas").first
    box = canvas.bounding_box()
    assert box is not None
    return Camera(
        position=position,
        look_at=look_at,
        fov=fov,
        left=box["x"],
        top=box["y"],
        width=box["width"],
        height=box["height"],
    )


def offer(page: Page, goals: set[str]) -> None:
    """Press the goal chips until exactly these goals are on offer."""
    for station in CELL.stations:
        chip = page.locator(f'[data-goal="{station.id}"]')
        wanted = "true" if station.id in goals else "false"
        if chip.get_attribute("aria-pressed") != wanted:
            chip.click()
        expect(chip).to_have_attribute("aria-pressed", wanted)


def state(server: str) -> dict:
    found: dict = httpx.get(f"{server}/v1/worlds/main").json()
    return found


def hand(server: str, name: str) -> np.ndarray:
    """Return where a hand is, as the service says [m]."""
    q = np.array(state(server)["state"]["people"][0]["q"])
    return np.array(human.joint_points(q, CELL.pelvis_z)[f"hand_{name[0]}"])


def drag(page: Page, camera: Camera, start: np.ndarray, way: np.ndarray) -> None:
    """Drag the arrow of a hand's gizmo along one axis by ``way`` [m]."""
    grip = start + GRIP_M * np.abs(np.sign(way))
    (x0, y0), (x1, y1) = camera.project(grip), camera.project(grip + way)
    page.mouse.move(x0, y0)
    page.wait_for_timeout(400)
    page.mouse.down()
    for k in range(1, MOVES + 1):
        page.mouse.move(x0 + (x1 - x0) * k / MOVES, y0 + (y1 - y0) * k / MOVES)
        page.wait_for_timeout(120)
    page.mouse.up()


def shown_choice(page: Page) -> str | None:
    chosen = page.locator('[data-chosen="true"]')
    return chosen.get_attribute("data-candidate") if chosen.count() else None


def settle(page: Page, server: str) -> str:
    """Wait until person and choice are at rest and the page shows them; return the choice."""
    before: list[float] = []
    for _ in range(100):
        page.wait_for_timeout(300)
        now = state(server)
        q = now["state"]["people"][0]["q"]
        if np.allclose(q, before or [np.inf], atol=1e-4) and shown_choice(page) == now["chosen"]:
            return str(now["chosen"])
        before = q
    raise AssertionError("person and choice do not come to rest")


def test_dragging_a_hand_onto_the_chosen_cube_changes_the_choice(
    open_page: Callable[..., Page], server: str, unused_port: int
) -> None:
    page = open_page(*SMALL)
    page.click('[data-mode="manual"]')
    page.click('[data-action="reset"]')
    offer(page, set(GOALS))
    page.click('[data-action="pause"]')
    expect(page.locator(".story .chip")).to_have_text("Paused")
    camera = first_camera(page, unused_port)
    chosen = settle(page, server)
    name, target = GOALS[chosen], np.array(CELL.station(chosen).position)
    for _ in range(TRIES):
        now = hand(server, name)
        miss = target - now
        axis = int(np.abs(miss).argmax())
        drag(page, camera, now, np.eye(3)[axis] * miss[axis])
        other = settle(page, server)
        if other != chosen:
            break
    assert other in set(GOALS) - {chosen}
    expect(page.locator(f'[data-candidate="{other}"]')).to_have_attribute("data-chosen", "true")
    asked = httpx.post(f"{server}/v1/task-selection", json=state(server)["state"]).json()
    assert asked["chosen"] == other
    values = {c["id"]: c["value"] for c in asked["candidates"]}
    assert values[other] > values[chosen]
    page.click('[data-action="pause"]')
    page.click('[data-mode="auto"]')
    assert page.problems == []  # type: ignore[attr-defined]
