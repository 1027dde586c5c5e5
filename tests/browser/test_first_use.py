"""A line over the scene says what to try, and its button sets it up."""

from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Page, expect

from app.sim.cells.cell import load_cell
from tests.browser.conftest import show
from tests.browser.test_drag import state, tell, until

pytestmark = pytest.mark.browser

LINE, TRY = '[data-role="first-use"]', '[data-action="try"]'


@pytest.fixture
def clean(server: str) -> Iterator[str]:
    """The server, in its first cell with a person at work afterwards."""
    yield server
    show(server, load_cell().name)
    tell(server, {"tag": "set-mode", "mode": "auto"})


def test_hint_places_a_hand_before_the_robot_and_stays_dismissed(
    open_page: Callable[..., Page], clean: str
) -> None:
    page = open_page(scene=False)
    page.click(TRY)
    until(clean, lambda now: now["people"][0]["mode"] == "manual")
    page.click('[data-action="dismiss-first-use"]')
    expect(page.locator(LINE)).to_have_count(0)
    page.reload()
    page.wait_for_selector(".sentence")
    expect(page.locator(LINE)).to_have_count(0)
    assert page.problems == []  # type: ignore[attr-defined]


def test_line_puts_the_person_beside_the_goal_of_a_reach_cell(
    open_page: Callable[..., Page], clean: str
) -> None:
    show(clean, "shared-workspace")
    tell(clean, {"tag": "set-goal-mode", "mode": "follow"})
    page = open_page(scene=False)
    page.click(TRY)
    goal = state(clean)["reach"]["goal"]
    until(
        clean,
        lambda now: (
            abs(now["people"][0]["cylinder"]["x"] - goal[0]) < 0.1
            and abs(now["people"][0]["cylinder"]["y"] - goal[1] - 0.3) < 0.1
        ),
    )


def test_line_starts_a_sorting_test(open_page: Callable[..., Page], clean: str) -> None:
    show(clean, "sorting-e0")
    page = open_page(scene=False)
    page.click(TRY)
    until(clean, lambda now: now["sorting"]["test"] == "test-1")
    expect(page.locator('[data-role="verdict"]')).to_contain_text("Every block is sorted")
