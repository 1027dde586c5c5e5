"""A visitor says what shall be sorted, and changes it while the robot works."""

from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Page, Route, expect

from app.sim.cells.cell import load_cell
from tests.browser.conftest import show
from tests.browser.test_drag import state, tell, until

pytestmark = pytest.mark.browser

PHONE = (390, 844)
BLOCKS = {
    "slot5": "red-large",
    "slot6": "red-small",
    "slot9": "blue-medium",
    "slot4": "blue-large",
}
"""What lies where at first; grasps hardly fail in these cells."""
SPEED = "8"
"""The clock runs as fast as the machine holds it."""


@pytest.fixture
def sorting(server: str) -> Iterator[str]:
    """The server with the sorting cell: four blocks, no goal, a person who stands still."""
    show(server, "sorting-e0")
    there = [{"tag": "remove-block", "id": one["id"]} for one in task(server)["blocks"]]
    tell(
        server, {"tag": "set-mode", "mode": "still"}, {"tag": "set-goal", "towers": {}}, *there
    )
    for cell, kind in BLOCKS.items():
        colour, size = kind.split("-")
        tell(server, {"tag": "add-block", "colour": colour, "size": size, "at": cell})
    yield server
    show(server, load_cell().name)


def task(server: str) -> dict:
    found: dict = state(server)["sorting"]
    return found


def towers(server: str) -> dict[str, list[str]]:
    """Return the sizes that stand on each tower, from the bottom."""
    found: dict[str, list[str]] = {"red": [], "blue": []}
    for one in sorted(task(server)["blocks"], key=lambda block: block["level"]):
        if one["place"] in found:
            found[one["place"]].append(f"{one['colour']}-{one['size']}")
    return found


def expect_chip(page: Page, text: str) -> None:
    expect(page.locator(".story .chip")).to_have_text(text)


def expect_reached(page: Page, n: int) -> None:
    """Wait until a goal of ``n`` blocks is reached, and not one that was asked for before."""
    text = page.locator('[data-role="goal-text"]')
    expect(text).to_contain_text(f"Reached: {n} blocks")
    expect_chip(page, "Goal reached")


def test_robot_reaches_a_goal_set_by_clicks_and_then_a_longer_one(
    open_page: Callable[..., Page], sorting: str
) -> None:
    page = open_page(scene=False)
    page.locator('[data-role="speed"]').select_option(SPEED)
    for kind in ("red-small", "red-large", "blue-medium"):
        page.click(f'[data-goal-add="{kind}"]')
    expect_reached(page, 3)
    assert towers(sorting) == {"red": ["red-large", "red-small"], "blue": ["blue-medium"]}
    before = state(sorting)
    page.click('[data-goal-add="blue-large"]')
    expect(page.locator(".story .chip")).not_to_have_text("Goal reached")
    page.click('[data-cell="slot7"]')
    page.click('[data-add="red-medium"]')
    page.click('[data-goal-add="red-medium"]')
    expect_reached(page, 5)
    assert towers(sorting) == {
        "red": ["red-large", "red-medium", "red-small"],
        "blue": ["blue-large", "blue-medium"],
    }
    after = state(sorting)
    assert after["t_s"] > before["t_s"]
    assert after["sorting"]["counters"]["moves"] > before["sorting"]["counters"]["moves"]
    assert page.problems == []  # type: ignore[attr-defined]


def test_goal_editor_says_why_a_block_cannot_be_asked_for(
    open_page: Callable[..., Page], sorting: str
) -> None:
    page = open_page(PHONE, scene=False)
    page.click('[data-action="pause"]')
    offer = page.locator('[data-goal-add="red-large"]')
    offer.click()
    expect(offer).to_be_disabled()
    expect(offer).to_have_attribute(
        "title", "The large red block is in the goal: add another below"
    )
    page.click('[data-add="red-large"]')
    expect(offer).to_be_enabled()
    page.click('[data-goal-block="red-0"]')
    expect(page.locator('[data-role="goal-text"]')).to_contain_text("No goal yet")
    # The page says at once what it has asked for.
    until(sorting, lambda now: now["sorting"]["goal"] == [])


@pytest.mark.usefixtures("sorting")
def test_chip_names_what_the_robot_does_after_the_goal_is_reached(
    open_page: Callable[..., Page],
) -> None:
    page = open_page(scene=False)
    status: list[str] = []

    def reached(route: Route) -> None:
        world = route.fetch().json()
        world["sorting"]["solved"] = True
        route.fulfill(json={**world, "status": status[-1]})

    page.route("**/v1/worlds/main/events", lambda _: None)  # what was shown first stays
    page.route("**/v1/worlds/main", reached)
    for now, text in (
        ("contact", "Contact"),
        ("blocked", "Waiting"),
        ("solved", "Goal reached"),
    ):
        status.append(now)
        page.reload()
        expect_chip(page, text)


@pytest.mark.usefixtures("sorting")
def test_focus_returns_to_the_cell_of_a_picked_block(open_page: Callable[..., Page]) -> None:
    page = open_page(scene=False)
    page.click('[data-action="pause"]')
    cell = page.locator('[data-cell="slot5"]')
    for button in ("Done", "Remove"):
        cell.press("Enter")
        page.locator(".picked-acts").get_by_role("button", name=button).press("Enter")
        expect(page.locator(".picked")).to_have_count(0)
        expect(cell).to_be_focused()
    expect(page.locator('[data-cell="slot5"][data-block]')).to_have_count(0)
    expect(cell).to_be_focused()


@pytest.mark.usefixtures("sorting")
def test_focus_stays_in_the_goal_when_its_last_block_is_taken_out(
    open_page: Callable[..., Page],
) -> None:
    page = open_page(scene=False)
    page.click('[data-action="pause"]')
    page.click('[data-goal-add="red-small"]')
    page.locator('[data-goal-block="red-0"]').press("Enter")
    expect(page.locator('[data-goal-add="red-large"]')).to_be_focused()
    page.keyboard.press("Enter")
    page.locator('[data-action="clear-goal"]').press("Enter")
    expect(page.locator("#goal-title")).to_be_focused()


def test_page_counts_the_commands_that_a_world_refuses(
    open_page: Callable[..., Page], sorting: str
) -> None:
    page = open_page(scene=False)
    page.click('[data-cell="slot7"]')
    page.evaluate(
        """() => [1, 2, 3].forEach(() =>
          document.querySelector('[data-add="red-medium"]').click())"""
    )
    expect(page.locator(".banner.bad")).to_contain_text("slot7")
    expect(page.locator(".banner.bad")).to_contain_text("(2 commands)")
    assert [one["place"] for one in task(sorting)["blocks"]].count("slot7") == 1


@pytest.mark.usefixtures("sorting")
def test_row_of_benchmark_tasks_counts_those_of_the_cell(
    open_page: Callable[..., Page],
) -> None:
    page = open_page(scene=False)
    row = page.locator(".dock-cases")
    expect(row).to_contain_text("6 sorting tests of the thesis")
    kept = [1]

    def fewer(route: Route) -> None:
        answer = route.fetch()
        cells = answer.json()
        for one in cells["items"]:
            one["sorting_tests"] = one["sorting_tests"][: kept[-1]]
        route.fulfill(response=answer, json=cells)

    page.route("**/v1/cells", fewer)
    page.reload()
    expect(row).to_contain_text("1 sorting test of the thesis")
    kept.append(0)
    page.reload()
    expect(page.locator(".towers")).to_be_visible()
    expect(row).to_have_count(0)


def test_moves_stay_in_the_panel_at_every_width(
    open_page: Callable[..., Page], sorting: str
) -> None:
    tell(sorting, {"tag": "set-goal", "towers": {"red": ["large", "small"]}})
    page = open_page(scene=False)
    page.wait_for_selector(".rank")
    for width in (1440, 1180, 1024, 900):
        page.set_viewport_size({"width": width, "height": 700})
        wider = "(({scrollWidth: all, clientWidth: seen}) => all - seen)"
        panel = "(document.querySelector('#panel-cell'))"
        assert page.evaluate(wider + panel) == 0, width


def test_sorting_page_fits_a_phone(open_page: Callable[..., Page], sorting: str) -> None:
    page = open_page(PHONE, scene=False)
    assert state(sorting)["cell"] == "sorting-e0"
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE[0]
    for part in ('[data-role="cell"]', "[data-case]", ".towers", ".plan", ".shelf", ".tiles"):
        page.locator(part).first.scroll_into_view_if_needed()
        expect(page.locator(part).first).to_be_visible()
