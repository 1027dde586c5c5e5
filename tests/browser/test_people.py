"""A visitor adds a person, makes one taller, and lets one move as recorded."""

from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.test_drag import state, until
from tests.sim.recorded_person import csv_text, working
from tests.support import patient_http

pytestmark = pytest.mark.browser


@pytest.fixture
def one_person(server: str) -> Iterator[str]:
    """The server, whose cell has one median person at work afterwards too."""
    yield server
    commands = f"{server}/v1/worlds/main/commands"
    for other in state(server)["people"][1:]:
        patient_http.post(commands, json={"tag": "remove-person", "person": other["id"]})
    patient_http.post(commands, json={"tag": "set-anthropometry", "stature": 50})
    patient_http.post(commands, json={"tag": "set-mode", "mode": "auto"})
    patient_http.delete(f"{server}/v1/recordings/visit")


@pytest.mark.usefixtures("one_person")
def test_double_click_removes_one_person(open_page: Callable[..., Page]) -> None:
    page = open_page(scene=False)
    people = page.locator("[data-person]")
    for present in (2, 3):
        page.click('[data-action="add-person"]')
        expect(people).to_have_count(present)
    page.locator('[data-action="remove-person"]').hover()
    for clicks, present in ((1, 2), (2, 2)):
        page.mouse.down(click_count=clicks)
        page.mouse.up(click_count=clicks)
        expect(people).to_have_count(present)
    page.click('[data-action="add-person"]')
    expect(people).to_have_count(3)
    assert page.problems == []  # type: ignore[attr-defined]


@pytest.mark.usefixtures("one_person")
def test_focus_goes_to_the_person_who_is_shown_when_another_one_is_removed(
    open_page: Callable[..., Page],
) -> None:
    page = open_page(scene=False)
    page.click('[data-action="add-person"]')
    page.click('[data-person="1"]')
    page.locator('[data-action="remove-person"]').press("Enter")
    expect(page.locator("[data-person]")).to_have_count(1)
    expect(page.locator('[data-person="0"]')).to_be_focused()


@pytest.mark.usefixtures("one_person")
def test_page_says_how_many_of_the_people_the_policy_observes(
    open_page: Callable[..., Page],
) -> None:
    page = open_page(scene=False)
    hint = page.locator(".dock-hint", has_text="Observed")
    for present in (2, 3):
        expect(hint).to_have_count(0)
        page.click('[data-action="add-person"]')
        expect(page.locator("[data-person]")).to_have_count(present)
    expect(hint).to_have_text("Observed: 2 of 3")


def test_visitor_adds_a_person_changes_its_size_and_plays_a_recording(
    open_page: Callable[..., Page], one_person: str
) -> None:
    server = one_person
    page = open_page(scene=False)
    page.click('[data-mode="recorded"]')
    empty = page.locator('[data-role="empty-motions"]')
    expect(empty).to_contain_text("recordings import")
    page.set_viewport_size({"width": 400, "height": 800})
    expect(empty).to_be_visible()
    page.set_viewport_size({"width": 1024, "height": 700})
    page.click('[data-action="add-person"]')
    page.click('[data-person="1"]')
    page.click('[data-action="size"]')
    page.locator('[data-size="stature"] input').fill("95")
    expect(page.locator('[data-role="stature-text"]')).to_have_text("1.87 m")
    now = until(server, lambda world: world["people"][1]["size"][11] > 1.08)
    assert [one["anthropometry"]["stature"] for one in now["people"]] == [50.0, 95.0]
    posted = patient_http.post(
        f"{server}/v1/recordings",
        params={"file_name": "visit.csv"},
        content=csv_text(working()),
        headers={"Content-Type": "text/csv"},
    )
    assert posted.status_code == 201
    page.click('[data-person="0"]')
    page.click('[data-mode="recorded"]')
    page.locator('[data-role="motion"]').select_option("visit")
    expect(page.locator('[data-role="progress"]')).to_contain_text("of 4.0 s")
    playing = until(
        server, lambda world: (world["people"][0]["motion"] or {}).get("t_s", 0) > 0.3
    )
    assert [one["mode"] for one in playing["people"]] == ["recorded", "auto"]
    page.set_viewport_size({"width": 1024, "height": 560})
    heights = "[...document.querySelectorAll('.viewer, .hero')].map((one) => one.clientHeight)"
    whole, scene = page.evaluate(heights)
    assert 200 < scene < whole, "the open controls scroll below the scene"
    page.locator("[data-case]").last.scroll_into_view_if_needed()
    expect(page.locator("[data-case]").last).to_be_in_viewport()
    assert page.problems == []  # type: ignore[attr-defined]
