"""The 3D scene outlives people who leave, other cells, and a server that stops or restarts."""

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, Route, expect

from app.sim.cells.cell import load_cell
from tests.browser.conftest import free_port, serving
from tests.browser.scene import VIEWER, expect_drawing, scene_of
from tests.browser.test_drag import state, tell, until
from tests.support import patient_http

pytestmark = pytest.mark.browser
WINDOWS = pytest.mark.xdist_group("scenes-in-windows")
SERVERS = pytest.mark.xdist_group("scenes-and-servers")
"""At most two processes draw the scene; others have time to wait."""

REACH, SORT = "shared-workspace", "sorting-e0"
LIMIT_S = 180.0


def show(server: str, cell: str) -> None:
    answer = patient_http.put(f"{server}/v1/worlds/main/cell", json={"cell": cell})
    assert answer.status_code == 200, answer.text


@pytest.fixture
def shown(server: str) -> Iterator[str]:
    """The server, which shows its first cell with one person at work, before and after."""
    show(server, load_cell().name)
    yield server
    show(server, load_cell().name)


@WINDOWS
def test_scene_goes_on_in_two_windows_while_people_come_and_go(
    open_page: Callable[..., Page], shown: str
) -> None:
    pages = [open_page((640, 480)), open_page((500, 600))]
    for page in pages:
        expect_drawing(page)
    pages[0].click('[data-action="add-person"]')
    until(shown, lambda now: len(now["people"]) == 2, LIMIT_S)
    expect_drawing(pages[1])
    pages[0].click('[data-person="1"]')
    pages[0].click('[data-action="remove-person"]')
    until(shown, lambda now: len(now["people"]) == 1, LIMIT_S)
    for page in pages:
        expect_drawing(page)
    tell(shown, {"tag": "set-anthropometry", "stature": 95}, {"tag": "add-person"})
    tell(shown, {"tag": "remove-person", "person": 0}, {"tag": "remove-person", "person": 1})
    until(shown, lambda now: now["people"] == [], LIMIT_S)
    tell(shown, {"tag": "add-person"}, {"tag": "add-person"})
    until(shown, lambda now: len(now["people"]) == 2, LIMIT_S)
    for page in pages:
        expect_drawing(page)
        assert page.locator('[data-role="scene-note"]').all_inner_texts() == []
        assert page.problems == []  # type: ignore[attr-defined]


@SERVERS
def test_scene_follows_into_other_cells_and_back_in_every_window(
    open_page: Callable[..., Page], shown: str
) -> None:
    pages = [open_page((640, 480)), open_page((500, 600))]
    for page in pages:
        expect_drawing(page)
    for cell in (REACH, SORT, load_cell().name):
        pages[0].locator('[data-role="cell"]').select_option(cell)
        until(shown, lambda now, cell=cell: now["cell"] == cell, LIMIT_S)
        for page in pages:
            expect(page.locator('[data-role="cell"]')).to_have_value(cell)
            expect_drawing(page)
            assert page.locator('[data-role="scene-note"]').all_inner_texts() == []


@SERVERS
def test_world_that_is_replaced_before_its_stream_begins_is_asked_for_again(
    open_page: Callable[..., Page], shown: str
) -> None:
    page = open_page(scene=False)
    states = "**/v1/worlds/main"

    def replace_then_answer(route: Route) -> None:
        page.unroute(states)
        old = route.fetch()
        show(shown, SORT)
        route.fulfill(response=old)

    page.route(states, replace_then_answer)
    show(shown, REACH)
    expect(page.locator('[data-role="cell"]')).to_have_value(SORT)
    expect(page.locator("[data-link]")).to_have_attribute("data-link", "live")
    assert page.problems == []  # type: ignore[attr-defined]


@WINDOWS
@pytest.mark.usefixtures("shown")
def test_scene_scrolled_out_of_view_is_not_taken_for_a_stopped_one(
    open_page: Callable[..., Page],
) -> None:
    page = open_page((500, 600))
    expect_drawing(page)
    scene_of(page).evaluate("() => { window.first = true; }")
    page.evaluate("() => scrollTo(0, document.documentElement.scrollHeight)")
    page.wait_for_timeout(15_000)
    page.evaluate("() => scrollTo(0, 0)")
    expect_drawing(page)
    assert scene_of(page).evaluate("() => window.first === true")
    assert page.locator('[data-role="scene-note"]').all_inner_texts() == []


@WINDOWS
@pytest.mark.parametrize(
    ("harm", "reason"),
    [
        (
            "document.querySelectorAll('canvas').forEach((one) => one.remove())",
            "its canvas was removed",
        ),
        (
            """[...document.querySelectorAll('canvas')].map((one) => one.getContext('webgl2'))
        .forEach((gl) => gl?.getExtension('WEBGL_lose_context').loseContext())""",
            "its graphics context was lost",
        ),
        ("WebGL2RenderingContext.prototype.clear = () => {}", "it drew nothing for 5 s"),
    ],
    ids=["its canvas is gone", "its graphics context is lost", "it draws no more"],
)
@pytest.mark.usefixtures("shown")
def test_failed_scene_is_reloaded_with_a_message(
    open_page: Callable[..., Page], harm: str, reason: str
) -> None:
    page = open_page((500, 600))
    expect_drawing(page)
    scene_of(page).evaluate(f"() => {{ {harm} }}")
    expect(page.locator('[data-role="scene-note"]')).to_contain_text(f"stopped ({reason})")
    expect_drawing(page)
    expect(page.locator('[data-link="live"]')).to_be_visible()


@SERVERS
def test_page_says_stale_while_the_server_is_frozen_and_goes_on_when_it_thaws(
    open_page: Callable[..., Page], tmp_path: Path
) -> None:
    with serving(tmp_path, free_port()) as (address, process):
        page = open_page((640, 700), address=address)
        expect_drawing(page)
        for cell in (load_cell().name, REACH, SORT):
            if cell != load_cell().name:
                show(address, cell)
                expect(page.locator('[data-role="cell"]')).to_have_value(cell)
                page.wait_for_selector('[data-link="live"]')
            os.kill(process.pid, signal.SIGSTOP)
            page.wait_for_selector('[data-link="stale"]')
            expect(page.locator('[data-role="link"]')).to_contain_text("Stale for")
            expect(page.locator('[data-role="stale"]')).to_contain_text("last known state")
            grey = page.locator(VIEWER).evaluate("frame => getComputedStyle(frame).filter")
            assert "grayscale" in grey
            page.click('[data-action="pause"]')
            expect(page.locator('[data-role="link"]')).to_have_attribute("data-pending", "1")
            expect(page.locator(".banner.bad")).to_contain_text("Not confirmed: pause")
            expect(page.locator('[data-role="link"]')).to_have_attribute("data-pending", "0")
            os.kill(process.pid, signal.SIGCONT)
            page.wait_for_selector('[data-link="live"]')
            expect(page.locator(".banner")).to_have_count(0)
            tell(address, {"tag": "resume"})
            expect_drawing(page)


@SERVERS
def test_page_and_scene_come_back_by_themselves_after_the_server_was_killed(
    open_page: Callable[..., Page], tmp_path: Path
) -> None:
    port = free_port()
    with serving(tmp_path, port) as (address, process):
        page = open_page((640, 700), address=address)
        expect_drawing(page)
        process.kill()
        page.wait_for_selector('[data-link="lost"]')
        expect(page.locator('[data-role="stale"]')).to_contain_text("does not answer")
        process.wait()
    with serving(tmp_path, port):
        page.wait_for_selector('[data-link="live"]')
        expect_drawing(page)
        page.click('[data-action="pause"]')
        until(address, lambda now: now["paused"], LIMIT_S)
        expect(page.locator('[data-role="link"]')).to_have_attribute("data-pending", "0")
        assert state(address)["people"]
