"""A visitor starts jobs by their forms, limits them and goes on."""

import json
import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from playwright.sync_api import Page, Route, expect

from app.sim.cells.cell import load_cell
from tests.browser.conftest import show
from tests.browser.test_drag import tell
from tests.browser.test_training import open_form, stop
from tests.support import patient_http

pytestmark = pytest.mark.browser

TINY = {
    "total_steps": 5120,
    "n_envs": 128,
    "buffer_size": 5000,
    "learning_starts": 0,
    "progress_steps": 128,
    "checkpoint_steps": 128,
}
"""A training of seconds with a point and a checkpoint at every step."""


def submit(page: Page) -> str:
    """Post the job of the form and return its id once it is open."""
    with page.expect_response(lambda one: one.request.method == "POST") as answer:
        page.click("form.train [type=submit]")
    job_id: str = answer.value.json()["id"]
    page.wait_for_selector(f'.job.is-open[data-job="{job_id}"]')
    return job_id


def state_of(page: Page) -> str | None:
    """Return the state of the open job once it has ended."""
    page.wait_for_selector(".job.is-open:is([data-state=succeeded], [data-state=failed])")
    return page.get_attribute(".job.is-open", "data-state")


def test_training_ends_at_its_budget_and_goes_on_with_a_larger_one(
    open_page: Callable[..., Page], server: str
) -> None:
    page = open_page((1280, 900), scene=False)
    open_form(page)
    page.click("form.train summary")
    for name, value in TINY.items():
        page.fill(f"#train-learning-{name}", str(value))
    page.fill("#train-step_budget", "none")
    page.fill("#train-time_budget_s", "30")
    page.click("form.train [type=submit]")
    expect(page.locator("#train-step_budget-error")).to_contain_text("integer")
    page.fill("#train-step_budget", "1000")
    job_id = submit(page)
    assert state_of(page) == "succeeded"
    ended = page.locator('.is-open [data-role="ended-by"]')
    expect(ended).to_contain_text("Ended by its step budget at 1024 of 5120 steps")
    expect(page.locator(".is-open .chip")).to_have_text("succeeded: step budget")
    assert job(server, job_id)["time_budget_s"] == 1800.0
    page.click('[data-action="resume-budget"]')
    expect(page.locator("#resume-step_budget-error")).to_contain_text("above the 1024 steps")
    page.fill("#resume-step_budget", "")
    page.click('[data-action="resume-budget"]')
    expect(ended).to_have_count(0)
    expect(page.locator(".job.is-open .job-sub")).to_contain_text("attempt 2")
    assert state_of(page) == "succeeded"
    assert job(server, job_id)["step"] == 5120
    expect(page.locator(".is-open [data-points]")).to_have_attribute("data-points", "40")
    assert len(page.problems) == 2  # type: ignore[attr-defined]  # two refusals


def test_number_beyond_those_of_json_is_refused(open_page: Callable[..., Page]) -> None:
    page = open_page((1280, 900), scene=False)
    open_form(page)
    page.fill("#train-learning-total_steps", "1e999")
    page.fill("#train-step_budget", "1e999")
    page.fill("#train-time_budget_s", "1e308")
    page.click("form.train [type=submit]")
    for name in ("step_budget", "time_budget_s"):
        expect(page.locator(f"#train-{name}-error")).to_be_visible()


def test_limits_of_a_time_budget_in_minutes_have_their_unit(
    open_page: Callable[..., Page],
) -> None:
    page = open_page((1280, 900), scene=False)
    open_form(page)
    expect(page.locator("#train-time_budget_s-help")).to_contain_text("1 s to 366 days.")
    for minutes in ("0.01", "600000"):
        page.fill("#train-time_budget_s", minutes)
        page.click("form.train [type=submit]")
        expect(page.locator("#train-time_budget_s-error")).to_have_text(
            "Must lie in [1, 31622400] s."
        )
        page.fill("#train-time_budget_s", "")
        expect(page.locator("#train-time_budget_s-error")).to_have_count(0)


def test_phone_offers_letters_for_a_name_and_digits_for_a_number(
    open_page: Callable[..., Page],
) -> None:
    page = open_page((1280, 900), scene=False)
    open_form(page)
    expect(page.locator("#train-name")).to_have_attribute("inputmode", "text")
    expect(page.locator("#train-seed")).to_have_attribute("inputmode", "decimal")


@pytest.fixture
def own_reach_cell(server: str) -> Iterator[str]:
    """Name of a reach cell that a test stores and shows; it is deleted after the test."""
    name = "own-reach"
    yield name
    show(server, load_cell().name)
    patient_http.delete(f"{server}/v1/cells/{name}")


def test_forms_propose_a_preset_for_a_cell_that_was_added_later(
    open_page: Callable[..., Page], server: str, own_reach_cell: str
) -> None:
    page = open_page((1280, 900), scene=False)
    open_form(page)
    expect(page.locator("#train-preset")).to_have_value("pick-td3")
    page.get_by_role("button", name="Close the form").click()
    definition = load_cell("shared-workspace").definition()
    own = json.loads(json.dumps({**definition, "name": own_reach_cell, "title": "Own"}))
    patient_http.post(f"{server}/v1/cells", json=own).raise_for_status()
    show(server, own_reach_cell)
    expect(page.locator('[data-role="cell"]')).to_have_value(own_reach_cell)
    open_form(page)
    expect(page.locator("#train-preset")).to_have_value("reach-td3")
    expect(page.locator("#train-cell")).to_have_value(own_reach_cell)
    page.click('[data-kind="sweep"]')
    expect(page.locator("#sweep-preset")).to_have_value("reach-td3")


def test_kind_of_job_obeys_the_arrow_keys(open_page: Callable[..., Page]) -> None:
    page = open_page((1280, 900), scene=False)
    open_form(page)
    page.focus('[data-kind="train"]')
    page.keyboard.press("ArrowRight")
    expect(page.locator('[data-kind="evaluate"]')).to_be_focused()
    expect(page.locator("#evaluate-protocol")).to_be_visible()
    page.keyboard.press("ArrowLeft")
    expect(page.locator('[data-kind="train"]')).to_be_focused()
    expect(page.locator("#train-seed")).to_be_visible()
    page.get_by_role("button", name="Close the form").press("Enter")
    expect(page.locator('[data-action="new-job"]')).to_be_focused()


def delete(page: Page, job_id: str) -> None:
    """Delete a job of the list by the keyboard."""
    row = page.locator(f'[data-job="{job_id}"]')
    if row.locator(".job-head").get_attribute("aria-expanded") == "false":
        row.locator(".job-head").press("Enter")
    row.locator('[data-action="delete"]').press("Enter")
    row.locator('[data-action="delete-yes"]').press("Enter")
    expect(row).to_have_count(0)


def test_focus_goes_to_the_next_job_when_one_is_deleted_and_then_to_the_heading(
    open_page: Callable[..., Page], server: str
) -> None:
    body = {"kind": "evaluate", "protocol": "pick-single", "priority": -100}
    made = [patient_http.post(f"{server}/v1/jobs", json=body).json()["id"] for _ in range(3)]
    oldest, old, newest = made
    page = open_page(scene=False)

    def only_made(route: Route) -> None:
        answer = route.fetch()
        items = [one for one in answer.json()["items"] if one["id"] in made]
        route.fulfill(response=answer, json={**answer.json(), "items": items})

    page.route(re.compile(r"/v1/jobs(\?.*)?$"), only_made)
    page.click("#tab-training")
    for one in made:
        row = page.locator(f'[data-job="{one}"]')
        if row.locator(".job-head").get_attribute("aria-expanded") == "false":
            row.locator(".job-head").press("Enter")
        row.locator('[data-action="cancel"]').press("Enter")
        row.locator('[data-action="cancel-yes"]').press("Enter")
        expect(row).to_have_attribute("data-state", "cancelled")
        expect(row.locator(".job-head")).to_be_focused()
    for gone, focused in ((old, oldest), (oldest, newest)):
        delete(page, gone)
        expect(page.locator(f'[data-job="{focused}"] .job-head')).to_be_focused()
    delete(page, newest)
    expect(page.locator("#jobs-title")).to_be_focused()


SWEEP = {
    "kind": "sweep",
    "preset": "pick-td3",
    "trials": 2,
    "ranges": {"learning.gamma": {"low": 0.9, "high": 0.99}},
    "objective": {"protocol": "pick-single", "quantity": "success"},
}


@pytest.mark.parametrize(
    ("body", "loss"),
    [
        (
            {"kind": "train", "preset": "pick-td3"},
            "Its curve and its checkpoints without an alias go with it.",
        ),
        ({"kind": "evaluate", "protocol": "pick-single"}, "Its result goes with it."),
        (
            {"kind": "report", "measure": True},
            "Its result goes with it; its evaluations become jobs of their own.",
        ),
        (SWEEP, "Its trials become jobs of their own."),
    ],
)
def test_question_before_a_job_is_deleted_says_what_goes_with_it(
    open_page: Callable[..., Page], server: str, body: dict[str, Any], loss: str
) -> None:
    posted = patient_http.post(f"{server}/v1/jobs", json=body)
    assert posted.status_code == 202, posted.text
    stop(server, posted.json())
    page = open_page(scene=False)
    page.click("#tab-training")
    row = page.locator(f'[data-job="{posted.json()["id"]}"]')
    if "is-open" not in (row.get_attribute("class") or ""):
        row.locator(".job-head").click()
    row.locator('[data-action="delete"]').click()
    expect(row.locator(".confirm > span")).to_have_text(f"Delete it? {loss}")
    row.locator('[data-action="delete-yes"]').click()
    expect(row).to_have_count(0)


def test_evaluation_is_started_with_choices_of_the_server(
    open_page: Callable[..., Page], server: str
) -> None:
    page = open_page((1280, 900), scene=False)
    open_form(page)
    page.click('[data-kind="evaluate"]')
    page.select_option("#evaluate-protocol", label="A sorting policy in the six tests")
    expect(page.locator("#evaluate-protocol-name")).to_have_text("sorting-tests")
    expect(page.locator("#evaluate-checkpoint")).to_contain_text("default: sorting-e0")
    expect(page.locator("#evaluate-checkpoint")).to_contain_text("sorting-e1")
    page.select_option("#evaluate-protocol", "pick-mocap")
    expect(page.locator("form.train").first).to_contain_text("No recording is stored yet")
    expect(page.locator("#evaluate-episodes-help")).to_contain_text("1 to 100\u202f000.")
    page.fill("#evaluate-episodes", "1000000")
    page.click("form.train [type=submit]")
    expect(page.locator("#evaluate-episodes-error")).to_contain_text("100000")
    page.fill("#evaluate-episodes", "2")
    page.click("form.train [type=submit]")
    expect(page.locator(".field-list .field-error")).to_contain_text("at least one motion")
    page.select_option("#evaluate-protocol", "pick-single")
    page.fill("#evaluate-name", "a look")
    job_id = submit(page)
    assert state_of(page) == "succeeded"
    made = job(server, job_id)
    assert (made["name"], made["spec"]["protocol"], made["seed"]) == (
        "a look",
        "pick-single",
        11,
    )
    expect(page.locator('.is-open [data-role="rows"]')).to_contain_text("success")
    output = page.locator('.is-open [data-action="log"]')
    expect(output).to_have_attribute("href", f"v1/jobs/{job_id}/log")
    assert "evaluate starts" in patient_http.get(f"{server}/v1/jobs/{job_id}/log").text
    expect(page.locator(".is-open .job-sub")).to_contain_text("One random target per episode")
    assert len(page.problems) == 2  # type: ignore[attr-defined]  # two refusals


def job(server: str, job_id: str | None) -> dict[str, Any]:
    found: dict[str, Any] = patient_http.get(f"{server}/v1/jobs/{job_id}").json()
    return found


def test_rates_of_a_sweep_are_those_of_its_preset(open_page: Callable[..., Page]) -> None:
    page = open_page((1280, 900), scene=False)
    open_form(page)
    page.click('[data-kind="sweep"]')
    rates = page.locator("#sweep-objective-quantity option")
    for preset, stated in (
        ("pick-td3", ["most success", "least collision", "least timeout"]),
        ("sorting-e0-dqn", ["most success", "least timeout"]),
    ):
        page.select_option("#sweep-preset", preset)
        expect(rates).to_have_text(stated)


def test_sweep_shows_its_trials_and_marks_the_best(
    open_page: Callable[..., Page], server: str
) -> None:
    page = open_page((1280, 900), scene=False)
    open_form(page)
    page.click('[data-kind="sweep"]')
    page.fill("#sweep-learning-total_steps", "51200")
    page.fill("#sweep-trials", "2")
    page.fill("#sweep-objective-episodes", "5")
    page.fill('[data-range="high"]', "1")
    page.click("form.train [type=submit]")
    expect(page.locator('[data-path="learning.lr_start"] .field-error')).to_contain_text("0.01")
    page.fill('[data-range="low"]', "0.0001")
    page.fill('[data-range="high"]', "0.001")
    page.check('[data-range="log"]')
    page.click('[data-action="add-range"]')
    drawn = page.locator(".drawn").last
    drawn.locator("select").select_option(label="Width of the hidden layers [units]")
    expect(drawn.locator("code")).to_have_text("networks.width")
    page.locator(".drawn").last.locator('[data-range="low"]').fill("16")
    page.locator(".drawn").last.locator('[data-range="high"]').fill("32")
    job_id = submit(page)
    page.wait_for_selector(".job.is-open [data-trial]")
    made = job(server, job_id)
    assert made["spec"]["ranges"]["learning.lr_start"] == {
        "low": 1e-4,
        "high": 1e-3,
        "log": True,
    }
    page.wait_for_selector('.job.is-open[data-state="succeeded"]')
    rows = page.locator('[data-role="trials"] tbody tr')
    expect(rows).to_have_count(2)
    expect(page.locator('[data-best="true"]')).to_have_count(1)
    expect(page.locator('[data-role="trials"] thead')).to_contain_text("Initial learning rate")
    expect(page.locator(".is-open .plot canvas")).to_have_count(1)
    best = job(server, job_id)["result"]["trial"]
    expect(page.locator('[data-best="true"]')).to_have_attribute("data-trial", str(best))
    page.locator(f'[data-trial="{best}"] button').click()
    expect(page.locator(".job.is-open .job-name")).to_contain_text(f"trial {best}")
    assert len(page.problems) == 1  # type: ignore[attr-defined]  # one refusal


def test_report_is_opened_and_its_evaluations_are_listed_with_it(
    open_page: Callable[..., Page], server: str
) -> None:
    page = open_page((1280, 900), scene=False)
    open_form(page)
    page.click('[data-kind="report"]')
    submit(page)
    assert state_of(page) == "succeeded"
    expect(page.locator('.is-open [data-role="report"]')).to_contain_text("From stored results")
    with page.context.expect_page() as opened:
        page.click('.is-open [data-action="open-report"]')
    expect(opened.value.locator("h1")).to_have_text("The thesis beside Tandem")
    assert opened.value.locator("img").first.evaluate("one => one.naturalWidth") > 100
    opened.value.close()
    open_form(page)
    page.click('[data-kind="report"]')
    page.select_option("#report-measure", "true")
    page.fill("#report-episodes", "0")
    page.click("form.train [type=submit]")
    expect(page.locator("#report-episodes-error")).to_contain_text("1")
    page.fill("#report-episodes", "1")
    job_id = submit(page)
    row = page.locator('.is-open [data-role="parts"] tbody tr').first
    expect(row).to_contain_text("pick-cases, pick")
    query = {"part_of": job_id}
    (part,) = patient_http.get(f"{server}/v1/jobs", params=query).json()["items"][-1:]
    expect(page.locator(f'[data-job="{part["id"]}"]')).to_have_count(0)
    row.locator("button").click()
    expect(page.locator(f'.is-open[data-job="{part["id"]}"]')).to_have_count(1)
    patient_http.post(f"{server}/v1/jobs/{job_id}/cancel")
    assert len(page.problems) == 1  # type: ignore[attr-defined]  # one refusal


def test_cell_follows_a_training_and_says_with_which_step(
    open_page: Callable[..., Page], server: str
) -> None:
    page = open_page((1280, 900), scene=False)
    open_form(page)
    page.click("form.train summary")
    for name, value in (TINY | {"total_steps": 128_000}).items():
        page.fill(f"#train-learning-{name}", str(value))
    job_id = submit(page)
    page.click('.is-open [data-action="follow"]')
    expect(page.locator('[data-role="follow"]')).to_contain_text("acts with")
    page.click('[data-action="unfollow"]')
    expect(page.locator('.is-open [data-action="follow"]')).to_have_count(1)
    page.click('.is-open [data-action="follow"]')
    patient_http.post(f"{server}/v1/jobs/{job_id}/cancel")
    expect(page.locator('[data-role="follow"]')).to_contain_text(
        "is cancelled: its last checkpoint acts"
    )
    tell(server, {"tag": "set-policy", "checkpoint": "pick"})
    assert page.problems == []  # type: ignore[attr-defined]
