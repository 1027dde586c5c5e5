"""The 3D scene outlives people who leave, and failures of its canvas."""

from collections.abc import Callable

import pytest
from playwright.sync_api import Page, expect

from tests.browser.scene import expect_drawing, scene_of
from tests.browser.test_drag import tell, until

pytestmark = pytest.mark.browser


def test_scene_goes_on_in_two_windows_while_people_come_and_go(
    open_page: Callable[..., Page], shown: str
) -> None:
    pages = [open_page((640, 480)), open_page((500, 600))]
    for page in pages:
        expect_drawing(page)
    pages[0].click('[data-action="add-person"]')
    until(shown, lambda now: len(now["people"]) == 2)
    expect_drawing(pages[1])
    pages[0].click('[data-person="1"]')
    pages[0].click('[data-action="remove-person"]')
    until(shown, lambda now: len(now["people"]) == 1)
    for page in pages:
        expect_drawing(page)
    tell(shown, {"tag": "set-anthropometry", "stature": 95}, {"tag": "add-person"})
    tell(shown, {"tag": "remove-person", "person": 0}, {"tag": "remove-person", "person": 1})
    until(shown, lambda now: now["people"] == [])
    tell(shown, {"tag": "add-person"}, {"tag": "add-person"})
    until(shown, lambda now: len(now["people"]) == 2)
    for page in pages:
        expect_drawing(page)
        assert page.locator('[data-role="scene-note"]').all_inner_texts() == []
        assert page.problems == []  # type: ignore[attr-defined]


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
