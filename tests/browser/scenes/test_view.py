"""What a window shows over the scene is its own, and the scene follows light and dark."""

from collections.abc import Callable

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.browser.scene import VIEWER, scene_of

pytestmark = pytest.mark.browser

SMALL, PHONE = (400, 320), (390, 500)
BEHIND = "getComputedStyle(document.querySelector('[data-dock-root]')).backgroundImage"
SEEN_PANELS = "all => all.filter((one) => one.checkVisibility()).length"

LISTS = """() => {
  const all = [];
  addEventListener("message", ({ data }) => data?.tag === "view-settings" && all.push(data));
  return all;
}"""
"""The view settings that the scene sends from now on."""
SLOW_MS = 120
SLOW_FRAMES = f"""() => new Promise((resolve) => {{
  const starts = [];
  const draw = () => {{
    const start = performance.now();
    starts.push(start);
    while (performance.now() <= start + {SLOW_MS});
    if (starts.length < 5) requestAnimationFrame(draw);
    else resolve(starts);
  }};
  requestAnimationFrame(draw);
}})"""
"""Resolves to the starts of five frames, each of which takes longer than that [ms]."""


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


def test_menu_stays_open_with_the_focus_while_the_scene_is_loaded_again(
    open_page: Callable[..., Page],
) -> None:
    page = open_page(SMALL)
    press(page, '[data-action="view"]')
    page.locator('[data-view="Values"]').focus()
    sent = page.evaluate_handle(LISTS)
    scene_of(page).evaluate("location.reload()")
    page.wait_for_function("all => all.length > 0", arg=sent)
    expect(page.locator('[data-view="Values"]')).to_be_focused()
    page.keyboard.press("Escape")
    expect(page.locator('[data-action="view"]')).to_be_focused()
    assert page.problems == []  # type: ignore[attr-defined]


def test_scene_that_draws_slowly_leaves_as_much_time_to_the_page(
    open_page: Callable[..., Page],
) -> None:
    scene = scene_of(open_page(SMALL))
    starts = scene.evaluate(SLOW_FRAMES)
    assert min(np.diff(starts)) >= 2 * SLOW_MS


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
