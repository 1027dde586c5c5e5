"""A visitor looks at the stored checkpoints, names one, uploads, compares and deletes one."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Page, Route, expect

from app.policies.checkpoints import pretrained
from tests.browser.test_training import open_form
from tests.support import patient_http

pytestmark = pytest.mark.browser

FOLDER = Path(pretrained.__file__).parent
NAME = "of-a-visitor"


def card(alias: str) -> str:
    return f'[data-checkpoint="{pretrained.SHA256[alias]}"]'


def uploaded(server: str, seed: int) -> str:
    """Store a checkpoint of a visitor; return its id."""
    shipped = pretrained.load("reach")
    manifest = json.dumps({**shipped.manifest, "seed": seed}).encode()
    stored = patient_http.post(
        f"{server}/v1/checkpoints",
        content=manifest + b"\n" + shipped.tensors,
        headers={"Content-Type": "application/octet-stream"},
    )
    return str(stored.json()["sha256"])


def opened(open_page: Callable[..., Page], alias: str) -> Page:
    page = open_page(scene=False)
    page.click("#tab-training")
    page.click(f"{card(alias)} .job-head")
    return page


def test_alias_is_added_and_removed(open_page: Callable[..., Page], server: str) -> None:
    page = opened(open_page, "reach")
    page.fill("[data-role=alias]", NAME)
    page.click("[data-action=alias]")
    alias = page.locator(f'button[title$="{NAME}"]')
    expect(alias).to_be_visible()
    found = patient_http.get(f"{server}/v1/aliases/{NAME}").json()
    assert found["checkpoint"] == pretrained.SHA256["reach"]
    alias.click()
    expect(alias).to_be_hidden()
    assert patient_http.get(f"{server}/v1/aliases/{NAME}").status_code == 404


def test_alias_that_has_no_route_is_refused_by_its_rule(open_page: Callable[..., Page]) -> None:
    page = opened(open_page, "reach")
    page.fill("[data-role=alias]", "line 3/left")
    page.click("[data-action=alias]")
    fault = page.locator(f"{card('reach')} .field-error")
    expect(fault).to_contain_text("An alias has 1 to 64 of the characters a-z 0-9 . _ -")


def test_shipped_checkpoint_says_so_and_keeps_its_alias(open_page: Callable[..., Page]) -> None:
    page = opened(open_page, "reach")
    expect(page.locator(f"{card('reach')} .job-sub")).to_have_text(
        "Reach (TD3) · 40.96 M steps · shipped"
    )
    expect(page.locator(f"{card('reach')} .uses")).to_have_text("Shipped")
    expect(page.get_by_title("Alias of a shipped checkpoint")).to_have_text("reach")
    expect(page.get_by_title("Remove the alias reach")).to_have_count(0)


def test_shipped_checkpoints_are_choices_behind_a_page_of_newer_ones(
    open_page: Callable[..., Page],
) -> None:
    page = open_page(scene=False)
    newest = "**/v1/checkpoints?limit=100"
    page.route(newest, lambda route: route.fulfill(json={"items": [], "next_cursor": None}))
    with page.expect_response("**/v1/checkpoints/pick"):
        page.locator("[data-role=acting]").focus()
    options = page.locator("[data-role=acting] optgroup[label=Shipped] option")
    expect(options).to_contain_text(
        ["pick · Pick and place (TD3)", "pick-monitored · Pick and place under SSM (TD3)"]
    )
    open_form(page)
    page.click('[data-kind="evaluate"]')
    page.select_option("#evaluate-protocol", "pick-single")
    expect(page.locator("#evaluate-checkpoint")).to_contain_text("pick-monitored · ")


def test_choice_of_the_active_policy_says_why_it_is_nearly_empty(
    open_page: Callable[..., Page],
) -> None:
    page, newest = open_page(scene=False), "**/v1/checkpoints?limit=100"
    page.route(newest, lambda route: route.fulfill(status=500, body=""))
    page.reload()
    acting = page.locator("[data-role=acting]")
    fault = acting.locator("option:disabled", has_text="could not be loaded")
    expect(fault).to_have_text("The checkpoints could not be loaded: the server answered 500.")
    expect(acting.locator("optgroup")).to_have_count(0)
    page.unroute(newest)
    acting.focus()
    expect(acting.locator("optgroup[label=Shipped] option")).not_to_have_count(0)
    expect(fault).to_have_count(0)


def test_active_policy_that_is_no_longer_stored_says_so(open_page: Callable[..., Page]) -> None:
    page, none = open_page(scene=False), {"items": [], "next_cursor": None}
    acting = page.locator("[data-role=acting]").input_value()
    for kind in ("checkpoints?limit=100", "aliases"):
        page.route(f"**/v1/{kind}", lambda route: route.fulfill(json=none))
    world = {"items": [{"id": "main", "follow": None, "unstored": [acting]}]}
    page.route("**/v1/worlds", lambda route: route.fulfill(json=world))
    page.locator("[data-role=acting]").focus()
    chosen = page.locator(f'[data-role=acting] option[value="{acting}"]')
    expect(chosen).to_contain_text("no longer stored")


def test_newest_list_of_checkpoints_is_not_replaced_by_an_older_answer(
    open_page: Callable[..., Page], server: str
) -> None:
    page = open_page(scene=False)
    acting = page.locator("[data-role=acting]")
    expect(acting.locator("optgroup[label=Shipped] option")).not_to_have_count(0)
    pick = patient_http.get(f"{server}/v1/checkpoints/pick").json()
    newer = {"items": [{**pick, "aliases": ["newer"]}], "next_cursor": None}
    older: list[Route] = []

    def answer(route: Route) -> None:
        if older:
            route.fulfill(json=newer)
        else:
            older.append(route)

    newest = "**/v1/checkpoints?limit=100"
    page.route(newest, answer)
    with page.expect_request(newest):
        acting.focus()
    acting.blur()
    acting.focus()
    page.wait_for_timeout(500)
    with page.expect_response(newest):
        older[0].continue_()
    page.wait_for_timeout(500)
    expect(acting.locator("option:checked")).to_contain_text("newer")


def test_record_without_outcomes_is_shown(open_page: Callable[..., Page]) -> None:
    """Older versions have stored records that are refused now."""

    def incomplete(route: Route) -> None:
        answer = route.fetch()
        stored = answer.json()
        for one in stored["items"]:
            one["manifest"]["recalibration"] = {"outcomes": None}
        route.fulfill(response=answer, json=stored)

    page = open_page(scene=False)
    page.route("**/v1/checkpoints?limit=100", incomplete)
    page.click("#tab-training")
    page.click(f"{card('reach')} .job-head")
    expect(page.locator(f"{card('reach')} .facts")).to_contain_text("0 outcomes, from –")


def test_uploaded_files_make_the_same_checkpoint(open_page: Callable[..., Page]) -> None:
    page = opened(open_page, "pick")
    files = page.locator("[data-role=checkpoint-files]")
    files.set_input_files([FOLDER / "reach.json"])
    expect(page.locator(".upload .field-error")).to_contain_text("two files")
    files.set_input_files([FOLDER / "reach.json", FOLDER / "reach.safetensors"])
    expect(page.locator(".upload [role=status]")).to_contain_text(
        pretrained.SHA256["reach"][:7]
    )


def test_two_checkpoints_are_compared_by_what_differs(open_page: Callable[..., Page]) -> None:
    page = opened(open_page, "sorting-e0")
    page.check(f"{card('sorting-e0')} [data-action=compare-checkpoint]")
    page.click(f"{card('sorting-e1')} .job-head")
    page.check(f"{card('sorting-e1')} [data-action=compare-checkpoint]")
    table = page.locator("[data-role=checkpoint-differences] table")
    expect(table.locator("tr", has=page.get_by_text("Cell", exact=True))).to_contain_text(
        "sorting-e1"
    )
    expect(table.get_by_role("row", name="Seed")).to_have_count(0)
    total = table.get_by_role("row", name="Total steps [env steps]")
    expect(total).to_contain_text("\u202f000")
    expect(total.locator("code")).to_have_text("learning.total_steps")
    page.get_by_role("button", name="Close the comparison").press("Enter")
    expect(page.locator("#checkpoints-title")).to_be_focused()


def test_uploaded_checkpoint_is_deleted_after_a_question(
    open_page: Callable[..., Page], server: str
) -> None:
    sha256 = uploaded(server, seed=81)
    own = f'[data-checkpoint="{sha256}"]'
    page = opened(open_page, "reach")
    expect(page.locator(f"{card('reach')} [data-action=delete-checkpoint]")).to_have_count(0)
    expect(page.locator(f"{own} .job-sub")).to_contain_text(re.compile("ago|just now"))
    page.click(f"{own} .job-head")
    expect(page.locator(f"{own} .uses")).to_have_text("Uploaded")
    page.click(f"{own} [data-action=delete-checkpoint]")
    page.get_by_role("button", name="Keep it").click()
    page.click(f"{own} [data-action=delete-checkpoint]")
    page.click(f"{own} [data-action=delete-checkpoint-yes]")
    expect(page.locator(own)).to_have_count(0)
    assert patient_http.get(f"{server}/v1/checkpoints/{sha256}").status_code == 404
