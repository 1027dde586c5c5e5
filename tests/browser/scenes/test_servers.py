"""The 3D scene outlives other cells, and a server that stops or restarts."""

import os
import signal
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Page, Route, expect

from app.sim.cells.cell import load_cell
from tests.browser.conftest import free_port, serving, show
from tests.browser.scene import VIEWER, expect_drawing
from tests.browser.scenes.conftest import REACH, SORT
from tests.browser.test_drag import state, tell, until

pytestmark = pytest.mark.browser


def test_scene_follows_into_other_cells_and_back_in_every_window(
    open_page: Callable[..., Page], shown: str
) -> None:
    pages = [open_page((640, 480)), open_page((500, 600))]
    for page in pages:
        expect_drawing(page)
    for cell in (REACH, SORT, load_cell().name):
        pages[0].locator('[data-role="cell"]').select_option(cell)
        until(shown, lambda now, cell=cell: now["cell"] == cell)
        for page in pages:
            expect(page.locator('[data-role="cell"]')).to_have_value(cell)
            expect_drawing(page)
            assert page.locator('[data-role="scene-note"]').all_inner_texts() == []


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
        until(address, lambda now: now["paused"])
        expect(page.locator('[data-role="link"]')).to_have_attribute("data-pending", "0")
        assert state(address)["people"]
