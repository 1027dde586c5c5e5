"""Every cell's page fits its window, can be read, and obeys the keyboard."""

import re
from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Page, expect

from app.sim.cells.cell import cell_names, load_cell
from tests.browser.conftest import show
from tests.browser.contrast import faint_text
from tests.browser.test_drag import state, tell, until
from tests.browser.test_training import open_form

pytestmark = pytest.mark.browser

DESKTOPS = ((1440, 900), (1280, 720), (1024, 700))
PHONE = (390, 844)
WIDTHS = (320, 480, 700, 860, 870, 900, 950, 1024, 1180, 1190, 1480, 1760)
SCENE_PX = 150
"""Least height that the dock leaves to the scene of a desktop."""

BARE_BUTTONS = """() => {
  const seen = [...document.querySelectorAll("button")].filter((one) => one.checkVisibility());
  const icons = seen.filter((one) => !one.innerText.trim());
  const faults = icons.filter((one) => !one.ariaLabel || !one.title);
  return { icons: icons.length, faults: faults.map((one) => one.outerHTML) };
}"""
"""Number of visible buttons without a visible text, and those without a name or a hint."""

BEYOND_THE_DOCK = """() => {
  const dock = document.querySelector(".dock").getBoundingClientRect();
  const controls = [...document.querySelectorAll(".dock :is(button, select, input)")];
  return controls.filter((one) => {
    const { left, right, width } = one.getBoundingClientRect();
    return width > 0 && !one.closest(".cases") && (left < dock.left || right > dock.right);
  }).map((one) => one.ariaLabel ?? one.innerText);
}"""
"""Controls beside the scene's dock; scenarios are scrolled to on a phone."""


TAGGED = """(() => {
  const parse = JSON.parse;
  const far = { field: "position.x", value: 3, low: 0, high: 1 };
  JSON.parse = (...all) => {
    const found = parse(...all);
    (found?.candidates ?? []).forEach((one, i) => {
      Object.assign(one, i % 2 ? { reachable: false } : { outside: [far] });
    });
    if (found?.candidates) found.chosen = null;
    return found;
  };
})()"""
"""Makes every candidate of the snapshots one that is out of reach or out of distribution."""

CUT_TAGS = """() => [...document.querySelectorAll(".bar-note .tag")].filter((one) => {
  const { right } = one.closest(".bars").getBoundingClientRect();
  const box = one.getBoundingClientRect();
  return box.right > right || one.scrollWidth > one.clientWidth || box.height > 28;
}).map((one) => one.innerText)"""
"""Tags beside the values that leave their row."""


BACKGROUND = "one => getComputedStyle(one).backgroundColor"


@pytest.fixture(params=cell_names())
def shown(request: pytest.FixtureRequest, server: str) -> Iterator[str]:
    """The server with one of the shipped cells."""
    show(server, request.param)
    yield server
    show(server, load_cell().name)


def size_of(page: Page) -> tuple[int, int]:
    """Return width and height of all there is to scroll to [px]."""
    found = page.evaluate(
        "(({scrollWidth: w, scrollHeight: h}) => [w, h])(document.documentElement)"
    )
    return int(found[0]), int(found[1])


@pytest.mark.usefixtures("shown")
def test_page_fits_its_window_and_its_text_stands_out(open_page: Callable[..., Page]) -> None:
    page = open_page(DESKTOPS[0], scene=False)
    page.wait_for_selector(".sentence")
    for tab in ("cell", "training"):
        page.click(f"#tab-{tab}")
        for size in DESKTOPS:
            page.set_viewport_size({"width": size[0], "height": size[1]})
            assert size_of(page) == size
            box = page.locator(".viewer").bounding_box()
            assert box is not None
            assert box["height"] > SCENE_PX
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
            assert faint_text(page) == [], (tab, scheme)
        page.set_viewport_size({"width": PHONE[0], "height": PHONE[1]})
        assert size_of(page)[0] == PHONE[0]
    assert page.problems == []  # type: ignore[attr-defined]


def test_description_of_the_interface_fits_a_phone(
    open_page: Callable[..., Page], server: str
) -> None:
    page = open_page(PHONE, scene=False)
    page.goto(f"{server}/docs")
    page.evaluate("document.querySelectorAll('details').forEach((one) => (one.open = true))")
    assert size_of(page)[0] == PHONE[0]


@pytest.mark.usefixtures("shown")
def test_controls_of_the_cell_stay_in_the_dock_at_every_width(
    open_page: Callable[..., Page],
) -> None:
    page = open_page((1280, 800), scene=False)
    page.wait_for_selector('[data-action="remove-person"]')
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 800})
        assert page.evaluate(BEYOND_THE_DOCK) == [], width


@pytest.mark.usefixtures("shown")
def test_buttons_without_a_text_have_a_name_and_a_hint(open_page: Callable[..., Page]) -> None:
    page = open_page((1180, 800), scene=False)
    page.wait_for_selector(".sentence")
    page.click("#tab-training")
    page.click('[data-action="new-job"]')
    page.click('[data-kind="sweep"]')
    page.click('[data-action="add-range"]')
    bare = page.evaluate(BARE_BUTTONS)
    assert bare["icons"] > 6
    assert bare["faults"] == []


def test_tags_of_candidates_stay_in_their_rows(open_page: Callable[..., Page]) -> None:
    page = open_page(DESKTOPS[0], scene=False)
    page.evaluate(TAGGED)
    expect(page.locator(".tag-warn").first).to_be_visible()
    expect(page.locator(".bar-head")).to_have_text(re.compile("Q *success *time"))
    for width in (1440, 1024, PHONE[0]):
        page.set_viewport_size({"width": width, "height": 800})
        assert page.evaluate(CUT_TAGS) == [], width


@pytest.mark.usefixtures("shown")
def test_arrow_keys_move_and_choose_in_every_radio_group(
    open_page: Callable[..., Page],
) -> None:
    page = open_page(DESKTOPS[0], scene=False)
    groups = page.get_by_role("radiogroup")
    expect(groups.first).to_be_visible()
    for k in range(groups.count()):
        radios = groups.nth(k).get_by_role("radio")
        stops = radios.evaluate_all("all => all.filter((one) => one.tabIndex === 0).length")
        assert stops == 1
        first, last = radios.first, radios.last
        first.click()
        expect(first).to_have_attribute("aria-checked", "true")
        page.keyboard.press("ArrowLeft")
        expect(last).to_be_focused()
        expect(last).to_have_attribute("aria-checked", "true")
        page.keyboard.press("ArrowDown")
        expect(first).to_be_focused()
        expect(first).to_have_attribute("aria-checked", "true")


def test_keyboard_sees_when_it_is_in_the_scene(open_page: Callable[..., Page]) -> None:
    page = open_page(scene=False)
    ring = "getComputedStyle(document.querySelector('.viewer'), '::after').borderTopStyle"
    assert page.evaluate(ring) == "none"
    page.locator('[data-action="pause"]').focus()
    for _ in range(40):
        page.keyboard.press("Shift+Tab")
        if page.evaluate("document.activeElement.dataset.role") == "viewer":
            break
    page.wait_for_selector(".viewer.is-keyed")
    assert page.evaluate(ring) == "solid"
    page.locator('[data-action="pause"]').click()
    page.locator(".viewer:not(.is-keyed)").wait_for()


def test_person_follows_the_mode_chosen_by_arrow_keys(
    open_page: Callable[..., Page], server: str
) -> None:
    tell(server, {"tag": "set-mode", "mode": "auto"})
    page = open_page(scene=False)
    page.locator('[data-mode="auto"]').focus()
    page.keyboard.press("ArrowLeft")
    until(server, lambda now: now["people"][0]["mode"] == "manual")
    expect(page.locator('[data-mode="manual"]')).to_be_focused()
    tell(server, {"tag": "set-mode", "mode": "auto"})
    assert state(server)["people"]


def test_drawn_fields_keep_the_focus_when_one_is_changed_or_removed(
    open_page: Callable[..., Page],
) -> None:
    page = open_page((1280, 900), scene=False)
    open_form(page)
    page.click('[data-kind="sweep"]')
    page.click('[data-action="add-range"]')
    for row in (page.locator(".drawn").first, page.locator(".drawn").last):
        before = row.get_attribute("data-path")
        row.locator("select").focus()
        page.keyboard.press("ArrowDown")
        expect(row).not_to_have_attribute("data-path", before or "")
        expect(row.locator("select")).to_be_focused()
    page.locator(".drawn").first.get_by_role("button").press("Enter")
    expect(page.locator(".drawn")).to_have_count(1)
    expect(page.locator(".drawn select")).to_be_focused()


@pytest.mark.usefixtures("shown")
def test_forced_colours_keep_what_is_chosen_apart(open_page: Callable[..., Page]) -> None:
    page = open_page(DESKTOPS[0], scene=False)
    page.wait_for_selector(".sentence")
    page.emulate_media(forced_colors="active")
    plain = page.locator('[data-action="reset"]').evaluate(BACKGROUND)
    for chosen in (".segmented [aria-checked=true]", ".who[aria-pressed=true]"):
        for one in page.locator(chosen).all():
            assert one.evaluate(BACKGROUND) != plain
    edges = page.locator("[role=tab]").evaluate_all(
        "all => all.map((one) => getComputedStyle(one).borderBottomColor)"
    )
    assert len(set(edges)) == len(edges)
    for coloured in (".who .swatch", ".shelf .block", ".meter-fill"):
        for one in page.locator(coloured).all()[:1]:
            assert one.evaluate(BACKGROUND) != plain
