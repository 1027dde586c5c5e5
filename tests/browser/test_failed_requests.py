"""What a visitor sees when a request fails, a clock is wrong, or a list is long."""

import re
from collections.abc import Callable
from typing import Any
from urllib.parse import parse_qs, urlsplit

import pytest
from playwright.sync_api import Page, Route, expect

from app.policies.checkpoints import pretrained
from jobs.executor import NO_CPU
from jobs.supervisor import OTHER_SERVER
from tests.browser.test_checkpoints import uploaded
from tests.browser.test_training import open_form
from tests.support import patient_http

pytestmark = pytest.mark.browser

WRONG_CLOCK = "const now = Date.now; Date.now = () => now() + 30 * 24 * 3600 * 1000;"
COMMANDS = "**/v1/worlds/main/commands"


def test_presets_are_loaded_after_a_failure(open_page: Callable[..., Page]) -> None:
    page = open_page(scene=False)
    page.route("**/v1/presets", lambda route: route.fulfill(status=502, body=""), times=1)
    open_form(page)
    expect(page.locator("#train-preset")).to_be_visible()


def test_size_is_that_of_the_world_after_a_failed_command(
    open_page: Callable[..., Page],
) -> None:
    page = open_page(scene=False)
    page.click('[data-action="size"]')
    slider = page.locator('[data-size="stature"] input')
    before = slider.input_value()
    page.route(COMMANDS, lambda route: route.fulfill(status=500, body=""))
    slider.fill("95")
    expect(page.locator(".banner.bad")).to_contain_text("The server answered 500.")
    expect(slider).to_have_value(before)
    page.unroute(COMMANDS)
    slider.fill("80")
    expect(slider).to_have_value("80")
    expect(page.locator('[data-size="stature"]')).to_contain_text("P80")


def test_checkpoint_of_another_purpose_is_not_evaluated(
    open_page: Callable[..., Page],
) -> None:
    pick = pretrained.SHA256["pick"]
    page = open_page(scene=False)
    sent: list[Any] = []

    def refuse(route: Any) -> None:
        if route.request.method == "GET":
            route.fallback()
            return
        sent.append(route.request.post_data_json["checkpoint"])
        route.fulfill(status=422, json={"detail": "refused"})

    page.route("**/v1/jobs", refuse)
    open_form(page)
    page.click('[data-kind="evaluate"]')
    for protocol in ("pick-single", "reach-random"):
        page.select_option("#evaluate-protocol", protocol)
        if protocol == "pick-single":
            page.select_option("#evaluate-checkpoint", pick)
        page.click("form.train button[type=submit]")
        expect(page.locator("form.train .notice.bad")).to_contain_text("Refused.")
    assert sent == [pick, None]


def test_cell_is_shown_while_the_list_of_cells_cannot_be_read(
    open_page: Callable[..., Page],
) -> None:
    page = open_page(scene=False)
    title = page.locator('.topbar [data-role="cell"]')
    expect(title).to_be_visible()
    away = {"title": "Service Unavailable", "detail": "the database is locked"}
    page.route("**/v1/cells", lambda route: route.fulfill(status=503, json=away))
    page.reload()
    expect(page.locator("[data-link=live] [data-chosen=true]")).to_be_visible()
    expect(title).to_have_count(0)
    expect(page.locator(".dock")).to_contain_text("The goals of this cell could not be loaded.")
    page.unroute("**/v1/cells")
    expect(title).to_be_visible()


def test_page_says_why_the_server_does_not_show_the_cell(
    open_page: Callable[..., Page],
) -> None:
    page = open_page(scene=False)
    fault = {"title": "Internal Server Error", "detail": "the cell has failed"}
    page.route("**/v1/worlds/main", lambda route: route.fulfill(status=500, json=fault))
    page.reload()
    expect(page.locator(".veil")).to_contain_text(
        "The cell has failed. Trying again every second."
    )
    expect(page.locator(".veil")).not_to_contain_text("does not answer")
    page.unroute("**/v1/worlds/main")
    expect(page.locator("[data-link=live]")).to_be_visible()


def test_list_of_jobs_says_that_it_is_old_or_not_complete(
    open_page: Callable[..., Page], server: str
) -> None:
    body = {"kind": "evaluate", "protocol": "pick-single", "episodes": 1, "priority": -100}
    job = patient_http.post(f"{server}/v1/jobs", json=body).json()
    patient_http.post(f"{server}/v1/jobs/{job['id']}/cancel").raise_for_status()
    jobs = [
        {**job, "id": f"job-{n}", "number": n, "state": "cancelled" if n == 1 else "queued"}
        for n in range(260, 0, -1)
    ]
    page = open_page(scene=False)
    page.route("**/v1/jobs?*", lambda route: route.fulfill(json=page_of(jobs, route)))
    page.reload()  # or a job of the server stays open
    page.click("#tab-training")
    expect(page.locator(".job")).to_have_count(259)
    expect(page.locator("#tab-training .count")).to_have_text("259")
    expect(page.locator(".training")).to_contain_text(
        "The newest 50 are shown, and older ones that have not ended."
    )
    for _ in range(5):
        page.click('[data-action="older-jobs"]')
    expect(page.locator(".job")).to_have_count(260)
    expect(page.locator('[data-action="older-jobs"]')).to_have_count(0)
    page.unroute("**/v1/jobs?*")
    page.route("**/v1/jobs?*", lambda route: route.fulfill(status=500, body=""))
    alert = page.locator(".training .notice.bad").first
    expect(alert).to_have_text(
        "The jobs could not be loaded: the server answered 500. Trying again every 2 s."
    )
    expect(page.locator(".job").first).to_be_visible()


@pytest.fixture
def cancelled(server: str) -> dict[str, Any]:
    """An evaluation that was cancelled before it began."""
    body = {"kind": "evaluate", "protocol": "pick-single", "episodes": 1, "priority": -100}
    job = patient_http.post(f"{server}/v1/jobs", json=body).json()
    path = f"{server}/v1/jobs/{job['id']}/cancel"
    found: dict[str, Any] = patient_http.post(path).raise_for_status().json()
    return found


@pytest.mark.parametrize(
    ("kind", "answered", "text"),
    [
        ("train", "events", "The connection to this job was lost; trying again."),
        ("sweep", "trials", "Its parts could not be loaded: the server answered 500."),
    ],
)
def test_open_job_says_what_could_not_be_read(
    open_page: Callable[..., Page],
    cancelled: dict[str, Any],
    kind: str,
    answered: str,
    text: str,
) -> None:
    failed = {"id": "job-1", "kind": kind, "state": "failed", "error": "its worker ended"}
    page = open_page(scene=False)
    page.route(
        "**/v1/jobs?*",
        lambda route: route.fulfill(json=page_of([{**cancelled, **failed}], route)),
    )
    page.route(f"**/v1/jobs/job-1/{answered}", lambda route: route.fulfill(status=500, body=""))
    page.reload()  # or a job of the server stays open
    page.click("#tab-training")
    detail = page.locator('[data-job="job-1"] .job-detail')
    expect(detail).to_contain_text(text)
    expect(detail).to_contain_text("Its worker ended.")
    expect(detail.locator(".empty")).to_have_count(0)


def test_followed_job_is_asked_for_again_after_a_failure(
    open_page: Callable[..., Page],
) -> None:
    page = open_page(scene=False)
    follow = {"job": "job-1", "active": False, "step": None, "reason": "it has ended"}
    world = {"id": "main", "follow": follow, "unstored": []}
    page.route("**/v1/worlds", lambda route: route.fulfill(json={"items": [world]}))
    page.route("**/v1/worlds", lambda route: route.fulfill(status=500, body=""), times=3)
    page.evaluate(
        """async () => {
          const page = (path) => import(`/static/${path}`);
          const { html, render } = await page("vendor/htm-preact-standalone.module.js");
          const { Follow } = await page("training/follow.js");
          const job = { id: "job-1", state: "cancelled" };
          const box = document.body.appendChild(document.createElement("div"));
          render(html`<${Follow} job=${job} />`, box);
        }"""
    )
    text = page.locator('[data-role="follow"]')
    expect(text).to_have_text("Followed no longer: it has ended.")


def page_of(jobs: list[dict[str, Any]], route: Route) -> dict[str, Any]:
    """Return the page of a list of jobs that a request asks for, as the service gives it."""
    asked = parse_qs(urlsplit(route.request.url).query)
    state, first = asked.get("state", [None])[0], int(asked.get("cursor", ["0"])[0])
    end = first + int(asked.get("limit", ["50"])[0])
    found = [job for job in jobs if state in (None, job["state"])]
    cursor = str(end) if end < len(found) else None
    return {"items": found[first:end], "next_cursor": cursor, "waiting": None}


WAITS = {
    "disk full": "Jobs are waiting: disk full. Free some space on the disk of the data folder.",
    "database locked": "Another program holds the database, such as a backup. No progress is",
    "database unavailable": "The database does not answer. No progress is lost, and the jobs",
    "database damaged": "What was stored since the backup is lost.",
    "no free resources": "The machine can start no further process. No progress is lost",
    "disk error": "reports errors: check it. The jobs resume once it can be used.",
    NO_CPU: "They start as soon as a node has a free CPU. No progress is lost",
    OTHER_SERVER: "Another server runs the jobs. It holds the lease of the database",
    "server unreachable": "A worker on another machine does not reach this server. No progress",
}
"""Part of what the page says for each reason for which jobs wait."""
LOSES = ("database damaged", "disk error", OTHER_SERVER)
"""Reasons for which progress may be lost, or jobs do not wait."""


def test_page_says_why_jobs_wait_and_what_happens_to_them(
    open_page: Callable[..., Page],
) -> None:
    page = open_page(scene=False)
    texts = page.evaluate(
        """async (reasons) => {
          const page = (path) => import(`/static/${path}`);
          const { html, render } = await page("vendor/htm-preact-standalone.module.js");
          const { QueueWaits } = await page("training/jobs.js");
          return reasons.map((waiting) => {
            const box = document.createElement("div");
            render(html`<${QueueWaits} waiting=${waiting} />`, box);
            return box.textContent.replace(/\\s+/g, " ");
          });
        }""",
        list(WAITS),
    )
    for (reason, shown), text in zip(WAITS.items(), texts, strict=True):
        assert shown in text
        assert ("The database does not answer." in text) == (reason == "database unavailable")
        assert ("No progress is lost" in text) == (reason not in LOSES)


def test_ages_are_by_the_clock_of_the_server(
    open_page: Callable[..., Page], server: str
) -> None:
    sha256 = uploaded(server, seed=82)
    page = open_page(scene=False)
    page.evaluate(WRONG_CLOCK)
    page.click("#tab-training")
    shown = page.locator(f'[data-checkpoint="{sha256}"] .job-sub')
    expect(shown).to_contain_text(re.compile("ago|just now"))
    expect(shown).not_to_contain_text("days")
    patient_http.delete(f"{server}/v1/checkpoints/{sha256}").raise_for_status()


def test_page_asks_for_the_token_when_its_session_has_ended(
    open_page: Callable[..., Page],
) -> None:
    page = open_page(scene=False)
    ended = {"title": "Unauthorized", "detail": "This server needs its token."}
    page.route("**/v1/jobs*", lambda route: route.fulfill(status=401, json=ended))
    expect(page.locator("#token")).to_be_visible()


def test_part_of_the_page_that_fails_leaves_the_others(open_page: Callable[..., Page]) -> None:
    page = open_page(scene=False)
    bad = {"id": "x", "number": 1, "kind": "evaluate", "state": "running", "spec": None}
    answer = {"items": [bad], "next_cursor": None, "waiting": None}
    page.route("**/v1/jobs*", lambda route: route.fulfill(json=answer))
    page.wait_for_timeout(2500)  # the list is asked for again
    page.click("#tab-training")
    failed = page.locator("#panel-training [role=alert]")
    expect(failed).to_contain_text("This part of the page has failed")
    page.click("#tab-cell")
    expect(page.locator("[data-chosen=true]")).to_be_visible()
    page.unroute("**/v1/jobs*")
    page.click("#tab-training")
    page.wait_for_timeout(2500)
    failed.get_by_role("button", name="Show it again").click()
    expect(page.locator("#jobs-title")).to_be_visible()


def test_change_of_the_protective_distance_is_nothing_else(
    open_page: Callable[..., Page],
) -> None:
    page = open_page(scene=False)
    for distance in (0.3, 0):
        with page.expect_request("**/commands") as sent:
            page.click(f'[data-choice="distance:{distance}"]')
        command = {"tag": "set-safety", "protective_distance": distance}
        assert sent.value.post_data_json == command
