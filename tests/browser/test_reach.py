"""A visitor opens the reach cell, sees the robot reach, and gets in its way."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from app.sim.cells.cell import load_cell
from tests.browser.conftest import show
from tests.browser.scene import drag_along
from tests.browser.test_drag import state, tell, until

pytestmark = pytest.mark.browser

CELL = load_cell("shared-workspace")
PHONE = (390, 844)
GRIP_M = 0.15
"""Where along the arrow of the goal's handle the mouse takes it; it is 0.26 m long."""


@pytest.fixture
def reaching(server: str) -> Iterator[str]:
    """The server with the reach cell, one person, the clock running."""
    show(server, CELL.name)
    yield server
    show(server, load_cell().name)


def goal(server: str) -> np.ndarray:
    """Return where the goal is, as the service says [m]."""
    return np.array(state(server)["reach"]["goal"])


def override(page: Page) -> float:
    shown = page.locator('[data-role="override"]').get_attribute("data-override")
    return float(shown or "nan")


def test_visitor_opens_the_cell_sees_it_reach_and_obstructs_it(
    open_page: Callable[..., Page], server: str
) -> None:
    page = open_page(scene=False)
    page.locator('[data-role="cell"]').select_option(CELL.name)
    page.wait_for_selector('[data-choice="safety:measured"]')  # which other cells lack
    page.click('[data-mode="manual"]')
    tell(server, {"tag": "move-person", "pelvis": [-2.0, 2.0, 0.0]})
    page.locator('[data-role="speed"]').select_option("4")
    now = until(server, lambda one: one["counters"]["reached"] > 0)
    expect(page.locator('[data-counter="reached"]')).not_to_have_text("0")
    now = until(server, lambda one: one["safety"]["override"] == 1.0)
    x, y, _ = now["tcp"]
    tell(server, {"tag": "move-person", "pelvis": [x, y + 0.3, 0.0]})
    expect(page.locator('[data-status="moving"]')).to_have_text("Stopped")
    expect(page.locator(".sentence")).to_contain_text("Stopped: the person")
    expect(page.locator('[data-role="override"]')).to_have_attribute("data-override", "0.000")
    page.click('[data-choice="safety:off"]')
    expect(page.locator('[data-role="override"]')).to_contain_text("disabled")
    page.click('[data-choice="safety:measured"]')
    page.click('[data-action="remove-person"]')
    until(server, lambda one: one["people"] == [])
    expect(page.locator('[data-role="override"]')).to_have_attribute("data-override", "1.000")
    assert page.problems == []  # type: ignore[attr-defined]
    page.locator('[data-role="cell"]').select_option(load_cell().name)
    page.wait_for_selector("[data-candidate]")


def test_two_quick_changes_of_the_policy_both_hold(
    open_page: Callable[..., Page], reaching: str
) -> None:
    page = open_page(scene=False)
    page.locator('[data-choice="ahead:true"][aria-checked=true]').wait_for()
    page.evaluate(
        """() => ["between:false", "ahead:false"].forEach((one) =>
             document.querySelector(`[data-choice="${one}"]`).click())"""
    )
    until(reaching, lambda one: one["reach"]["inference_mode"] == "direct")


def test_goal_is_dragged_by_its_arrow(open_page: Callable[..., Page], reaching: str) -> None:
    tell(
        reaching,
        {"tag": "remove-person", "person": 0},
        {"tag": "set-goal-mode", "mode": "follow"},
        {"tag": "move-goal", "position": [0.1, 0.7, 0.15]},
        {"tag": "pause"},
    )
    page = open_page()
    start = goal(reaching)
    drag_along(page, CELL, lambda: goal(reaching), np.array([0.0, 0.0, 0.2]), GRIP_M)
    moved = goal(reaching) - start
    assert moved[2] > 0.1
    assert np.allclose(moved[:2], 0.0, atol=0.02)


def test_reach_page_fits_a_phone(open_page: Callable[..., Page], reaching: str) -> None:
    page = open_page(PHONE, scene=False)
    assert state(reaching)["cell"] == CELL.name
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE[0]
    for part in ('[data-choice="safety:assumed"]', ".gauge", ".terms", ".tiles"):
        page.locator(part).first.scroll_into_view_if_needed()
        expect(page.locator(part).first).to_be_visible()
