"""What a window shows over the scene is its own, and the scene follows light and dark."""

from collections.abc import Callable

import pytest
from playwright.sync_api import Page, expect

from tests.browser.scene import VIEWER
from tests.browser.test_scene import WINDOWS

pytestmark = [pytest.mark.browser, WINDOWS]

SMALL, PHONE = (400, 320), (390, 500)
BEHIND = "getComputedStyle(document.querySelector('[data-dock-root]')).backgroundImage"
SEEN_PANELS = "all => all.filter((one) => one.checkVisibility()).length"


def shown_by_viewer(page: Page, name: str) -> bool:
    """Return what the viewer's own, hidden check box says."""
    label = page.frame_locator(VIEWER).locator("label", has_text=f"view: {name}").first
    box = label.evaluate("(one) => document.getElementById(one.htmlFor).checked")
    return bool(box)


def press(page: Page, part: str) -> None:
    """Click at once: a page that draws two scenes would wait long until a part stands still."""
    page.locator(part).evaluate("one => one.click()")


def test_each_window_has_its_own_view_settings(open_page: Callable[..., Page]) -> None:
    one = open_page(SMALL)
    press(one, '[data-action="view"]')
    expect(one.locator('[data-view="Collision shapes"]')).not_to_be_checked()
    press(one, '[data-view="Values"]')
    expect(one.locator('[data-view="Values"]')).not_to_be_checked()
    other = open_page(SMALL)
    press(other, '[data-action="view"]')
    expect(other.locator('[data-view="Values"]')).to_be_checked()
    press(other, '[data-view="Target line"]')
    expect(other.locator('[data-view="Target line"]')).not_to_be_checked()
    assert (shown_by_viewer(one, "Values"), shown_by_viewer(one, "Target line")) == (
        False,
        True,
    )
    assert not shown_by_viewer(other, "Target line")
    assert shown_by_viewer(other, "Values")
    other.close()
    one.reload()
    press(one, '[data-action="view"]')
    expect(one.locator('[data-view="Values"]')).not_to_be_checked()
    assert not shown_by_viewer(one, "Values")
    one.keyboard.press("Escape")
    expect(one.locator('[data-view="Values"]')).to_have_count(0)
    expect(one.locator('[data-action="view"]')).to_be_focused()
    assert one.problems == []  # type: ignore[attr-defined]


def test_viewers_own_panel_is_never_seen_and_the_scene_follows_dark(
    open_page: Callable[..., Page],
) -> None:
    page = open_page(PHONE)
    page.wait_for_selector('[data-action="view"]')
    panels = page.frame_locator(VIEWER).locator(".mantine-Paper-root")
    assert panels.count() > 0
    assert panels.evaluate_all(SEEN_PANELS) == 0
    frame = page.frames[-1]
    light = frame.evaluate(BEHIND)
    page.emulate_media(color_scheme="dark")
    dark = frame.evaluate(BEHIND)
    assert "gradient" in light
    assert "gradient" in dark
    assert light != dark
