"""A visitor imports a recording and states what its file does not tell."""

from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import pytest
from playwright.sync_api import Page, Route, expect

from tests.sim.recorded_person import csv_text, working
from tests.sim.recorded_skeleton import Person, skeleton
from tests.support import patient_http

pytestmark = pytest.mark.browser


@pytest.fixture
def emptied(server: str) -> Iterator[str]:
    """The server; what was imported is removed again and the person works."""
    yield server
    for name in ("mixed", "angles", "foreign"):
        patient_http.delete(f"{server}/v1/recordings/{name}")
    patient_http.post(
        f"{server}/v1/worlds/main/commands", json={"tag": "set-mode", "mode": "auto"}
    )


def first_of(page: Page, held: list[Route]) -> Route:
    """Return the first request of the page that is held back, once the page has sent it."""
    for _ in range(600):
        if held:
            return held[0]
        page.wait_for_timeout(50)
    raise AssertionError("the page has sent nothing")


@pytest.mark.usefixtures("emptied")
def test_visitor_states_the_unit_that_a_file_leaves_open(
    open_page: Callable[..., Page], tmp_path: Path
) -> None:
    clip = tmp_path / "mixed.bvh"
    clip.write_text(skeleton(Person(unit=0.01, root_unit=1.0))[0], encoding="utf-8")
    page = open_page(scene=False)
    page.click('[data-mode="recorded"]')
    page.set_input_files('[data-role="import-file"]', clip)
    page.click('[data-action="import"]')
    expect(page.locator('[data-role="import-error"]')).to_contain_text("root_unit = cm or m")
    page.locator('[data-role="import-root-unit"]').fill("m")
    page.click('[data-action="import"]')
    result = page.locator('[data-role="import-result"]')
    expect(result).to_contain_text(
        "mixed read as: cm, y up, root's path in m, 50 frames/s, 1.7"
    )
    expect(page.locator('[data-role="motion"]')).to_contain_text("mixed")
    expect(page.locator('[data-role="import-error"]')).to_have_count(0)


@pytest.mark.usefixtures("emptied")
def test_note_on_a_file_is_a_sentence(open_page: Callable[..., Page], tmp_path: Path) -> None:
    clip = tmp_path / "mixed.bvh"
    raised = Person(unit=0.01, legs=False, floor=0.5)
    clip.write_text(skeleton(raised)[0], encoding="utf-8")
    page = open_page(scene=False)
    page.click('[data-mode="recorded"]')
    page.set_input_files('[data-role="import-file"]', clip)
    page.click('[data-action="import"]')
    result = page.locator('[data-role="import-result"]')
    expect(result).to_contain_text("cut out. The file's zero is not the floor: ")
    expect(result).to_contain_text("cannot be verified.")


def test_no_other_file_is_chosen_while_one_is_read(
    open_page: Callable[..., Page], tmp_path: Path
) -> None:
    clip = tmp_path / "empty.csv"
    clip.write_text("time\n", encoding="utf-8")
    page = open_page(scene=False)
    held: list[Route] = []
    page.route("**/v1/recordings?*", lambda route: held.append(route))
    page.click('[data-mode="recorded"]')
    chooser = page.locator('[data-role="import-file"]')
    chooser.set_input_files(clip)
    page.click('[data-action="import"]')
    expect(chooser).to_be_disabled()
    first_of(page, held).continue_()
    expect(page.locator('[data-role="import-error"]')).to_be_visible()
    expect(chooser).to_be_enabled()


def test_what_is_stated_of_one_file_is_not_shown_for_the_next(
    open_page: Callable[..., Page], tmp_path: Path
) -> None:
    clips = [tmp_path / "first.bvh", tmp_path / "second.bvh"]
    for clip in clips:
        clip.write_text("HIERARCHY\n", encoding="utf-8")
    page = open_page(scene=False)
    page.click('[data-mode="recorded"]')
    page.set_input_files('[data-role="import-file"]', clips[0])
    page.locator('[data-role="import-unit"]').fill(" cm ")
    page.locator('[data-role="import-names"]').fill("Spine = chest; Neck=head ")
    page.select_option('[data-role="import-up"]', "z")
    for sent in (
        {"unit": ["cm"], "up": ["z"], "map": ["Spine = chest", "Neck=head"]},
        {},
    ):
        with page.expect_request("**/v1/recordings?*") as request:
            page.click('[data-action="import"]')
        asked = parse_qs(urlsplit(request.value.url).query)
        assert {name: asked[name] for name in asked if name != "file_name"} == sent
        expect(page.locator('[data-role="import-error"]')).to_be_visible()
        page.set_input_files('[data-role="import-file"]', clips[1])
        for role in ("import-unit", "import-root-unit", "import-up", "import-names"):
            expect(page.locator(f'[data-role="{role}"]')).to_have_value("")


@pytest.mark.usefixtures("emptied")
def test_file_is_sent_once_however_often_import_is_clicked(
    open_page: Callable[..., Page], tmp_path: Path
) -> None:
    clip = tmp_path / "angles.csv"
    clip.write_text(csv_text(working()), encoding="utf-8")
    page = open_page(scene=False)
    held: list[Route] = []
    page.route("**/v1/recordings?*", lambda route: held.append(route))
    page.click('[data-mode="recorded"]')
    page.set_input_files('[data-role="import-file"]', clip)
    page.eval_on_selector("form.import", "(one) => [1, 2].map(() => one.requestSubmit())")
    expect(page.locator('[data-action="import"]')).to_be_disabled()
    page.dblclick('[data-action="import"]', force=True)
    first_of(page, held).continue_()
    expect(page.locator('[data-role="import-result"]')).to_contain_text("angles read as: m")
    assert len(held) == 1


@pytest.mark.usefixtures("emptied")
def test_file_of_angles_has_no_unit_to_state(
    open_page: Callable[..., Page], tmp_path: Path
) -> None:
    clip = tmp_path / "angles.csv"
    clip.write_text(csv_text(working()), encoding="utf-8")
    page = open_page(scene=False)
    page.click('[data-mode="recorded"]')
    page.set_input_files('[data-role="import-file"]', clip)
    expect(page.locator('[data-action="import"]')).to_be_visible()
    expect(page.locator('[data-role="import-unit"]')).to_have_count(0)
    page.click('[data-action="import"]')
    expect(page.locator('[data-role="import-result"]')).to_contain_text("angles read as: m")
    assert page.problems == []  # type: ignore[attr-defined]


@pytest.mark.usefixtures("emptied")
def test_visitor_says_what_foreign_columns_are(
    open_page: Callable[..., Page], tmp_path: Path
) -> None:
    text = csv_text(working()).replace("elbow_r", "coude d").replace("elbow_l", "elbow_left")
    lines = text.splitlines()
    lines[50] = f"{lines[50].rpartition(',')[0]},NaN"
    clip = tmp_path / "foreign.csv"
    clip.write_text("\n".join(lines), encoding="utf-8")
    page = open_page(scene=False)
    page.click('[data-mode="recorded"]')
    page.set_input_files('[data-role="import-file"]', clip)
    page.click('[data-action="import"]')
    expect(page.locator('[data-role="import-error"]')).to_contain_text(
        "give the name map elbow_left=elbow_l"
    )
    page.locator('[data-role="import-names"]').fill("coude d = elbow_r; elbow_left=elbow_l;")
    page.click('[data-action="import"]')
    expect(page.locator('[data-role="import-result"]')).to_contain_text(
        "1 clean run, 1 cut out (frame 48: no value of elbow_l)"
    )
    stored = page.evaluate("fetch('v1/recordings/foreign').then((one) => one.json())")
    assert stored["options"] == {"names": {"coude d": "elbow_r", "elbow_left": "elbow_l"}}
