"""A visitor starts a training job on the page and watches it learn."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from app.policies.checkpoints import pretrained
from app.policies.evaluation.statistics import wilson
from tests.browser.test_drag import state, tell
from tests.support import patient_http

pytestmark = pytest.mark.browser

FINE = {"learning": {"progress_steps": 5120, "checkpoint_steps": 5120}}
"""Points and checkpoints close together, so that the curve grows while one looks."""


def open_form(page: Page) -> None:
    page.click("#tab-training")
    page.click('[data-action="new-job"]')
    page.wait_for_selector("form.train")


def points(page: Page) -> int:
    text = page.get_attribute("[data-points]", "data-points")
    return int(text or 0)


def test_posted_job_appears_and_its_curve_grows(
    open_page: Callable[..., Page], server: str
) -> None:
    page = open_page(scene=False)
    open_form(page)
    page.fill("#train-seed", "7")
    page.click("form.train summary")
    for name, value in FINE["learning"].items():
        page.fill(f"#train-learning-{name}", str(value))
    with page.expect_response(lambda one: one.request.method == "POST") as answer:
        page.click("form.train button[type=submit]")
    job_id = answer.value.json()["id"]
    page.wait_for_selector(f'.job.is-open[data-job="{job_id}"]')
    page.wait_for_selector("[data-points]")
    seen = points(page)
    page.wait_for_function(
        "n => Number(document.querySelector('[data-points]').dataset.points) >= n + 2",
        arg=seen,
    )
    stored = patient_http.get(f"{server}/v1/jobs/{job_id}/metrics").json()["items"]
    steps = [row["step"] for row in stored]
    assert steps == sorted(set(steps))
    assert len(steps) >= seen + 2
    job = patient_http.get(f"{server}/v1/jobs/{job_id}").json()
    assert (job["seed"], job["overrides"]) == (7, FINE)
    expect(page.locator('[data-role="point"]')).to_contain_text("episodes")
    expect(page.locator(".job-detail .legend").first).to_contain_text(" to ")
    cancel(page)
    resume(page, job_id)
    assert page.problems == []  # type: ignore[attr-defined]
    page.close()
    newest_acts_though_the_stream_is_behind(open_page, server, job_id)


def newest_acts_though_the_stream_is_behind(
    open_page: Callable[..., Page], server: str, job_id: str | None
) -> None:
    """Let a job act while its page has read no more than the first checkpoint's event."""
    known = patient_http.get(f"{server}/v1/checkpoints", params={"job_id": job_id}).json()
    newest, first = known["items"][0], known["items"][-1]
    assert newest["step"] > first["step"]
    page = open_page(scene=False)
    page.route(
        f"**/v1/jobs/{job_id}/events",
        lambda route: route.fulfill(
            content_type="text/event-stream",
            body=f'id: 1\nevent: checkpoint\ndata: {{"sha256": "{first["sha256"]}"}}\n\n'
            "event: end\ndata: {}\n\n",
        ),
    )
    page.click("#tab-training")
    page.click('[data-action="act"]')
    steps = f"{newest['step'] / 1e3:.1f}".removesuffix(".0")
    expect(page.locator('[data-role="acts"]')).to_contain_text(f"with {steps} k steps")
    assert state(server)["checkpoint"] == newest["sha256"]
    tell(server, {"tag": "set-policy", "checkpoint": "pick"})


def resume(page: Page, job_id: str | None) -> None:
    """Resume the open job from its last state, see its curve grow on, and cancel it again."""
    before = points(page)
    page.click('.is-open [data-action="resume"]')
    page.wait_for_function(
        "n => Number(document.querySelector('[data-points]').dataset.points) > n",
        arg=before,
    )
    expect(page.locator(".job.is-open")).to_have_attribute("data-job", job_id or "")
    expect(page.locator(".job.is-open .job-sub")).to_contain_text("attempt 2")
    cancel(page)


@pytest.fixture
def ended(server: str) -> dict[str, Any]:
    """A training that was cancelled before its first checkpoint."""
    overrides = {"learning": {"gamma": 0.97}}
    body = {"kind": "train", "preset": "pick-td3", "seed": 1, "overrides": overrides}
    job: dict[str, Any] = patient_http.post(f"{server}/v1/jobs", json=body).json()
    stop(server, job)
    return job


def stop(server: str, job: dict[str, Any]) -> None:
    """Cancel a job and wait for its end."""
    patient_http.post(f"{server}/v1/jobs/{job['id']}/cancel")
    patient_http.get(f"{server}/v1/jobs/{job['id']}/events")


def posted(page: Page, path: str, act: Callable[[], None]) -> dict[str, Any]:
    """Return the job of the answer to a request that an action sends."""
    with page.expect_response(f"**/v1/jobs/{path}") as found:
        act()
    job: dict[str, Any] = found.value.json()
    return job


DRAWN_CLOSED = """() => {
  window.drawnClosed = [];
  const look = new MessageChannel();
  look.port1.onmessage = () => {
    const jobs = document.querySelectorAll(".job");
    if (jobs.length) window.drawnClosed.push(!document.querySelector(".job.is-open"));
  };
  new MutationObserver(() => look.port2.postMessage(0))
    .observe(document.body, { childList: true, subtree: true });
}"""
"""Script that notes, in a task after each change of the page, whether no job is open."""


@pytest.mark.usefixtures("ended")
def test_first_job_is_drawn_open(open_page: Callable[..., Page]) -> None:
    page = open_page(scene=False)
    page.evaluate(DRAWN_CLOSED)
    page.click("#tab-training")
    page.wait_for_selector(".job.is-open .job-actions")
    page.wait_for_function("drawnClosed.length > 0")
    assert not any(page.evaluate("drawnClosed"))


def test_ended_job_is_retried_cloned_and_named(
    open_page: Callable[..., Page], server: str, ended: dict[str, Any]
) -> None:
    page = open_page(scene=False)
    page.click("#tab-training")
    row = page.locator(f'[data-job="{ended["id"]}"]')
    if "is-open" not in (row.get_attribute("class") or ""):
        row.locator(".job-head").click()
    expect(row.locator('[data-action="resume"]')).to_have_count(0)
    row.locator("summary").click()
    row.locator("#label-name").fill("a baseline")
    row.locator("#label-priority").fill("1000")
    row.locator('[data-action="save-labels"]').click()
    expect(row.locator(".field-error")).to_contain_text("100")
    row.locator("#label-priority").fill("5")
    row.locator("#label-notes").fill("to compare with")
    row.locator('[data-action="save-labels"]').click()
    expect(row.locator(".job-name")).to_contain_text("a baseline")
    expect(row.locator('[data-role="notes"]')).to_have_text("to compare with")
    row.locator('[data-action="clone"]').click()
    expect(page.locator("#train-learning-gamma")).to_have_value("0.97")
    page.fill("#train-seed", "2")
    clone = posted(page, f"{ended['id']}/clone", lambda: page.click("form.train [type=submit]"))
    assert (clone["seed"], clone["overrides"], clone["parent"]) == (
        2,
        ended["overrides"],
        ended["id"],
    )
    expect(page.locator(".job.is-open .job-sub")).to_contain_text("from job")
    row.locator(".job-head").click()
    retry = row.locator('[data-action="retry"]')
    again = posted(page, f"{ended['id']}/retry", lambda: retry.click())
    assert (again["spec"], again["priority"]) == (ended["spec"], 5)
    expect(page.locator(f'[data-job="{again["id"]}"]')).to_have_class(re.compile("is-open"))
    row.locator(".job-head").click()
    retry.click()
    expect(row.locator(".job-actions .field-error")).to_contain_text("wait for it")
    row.locator('[data-action="delete"]').press("Enter")
    expect(row.get_by_text("Keep it")).to_be_focused()
    page.keyboard.press("Escape")
    expect(row.locator('[data-action="delete"]')).to_be_focused()
    page.keyboard.press("Enter")
    row.locator('[data-action="delete-yes"]').click()
    expect(row).to_have_count(0)
    expect(page.locator(".job.is-open")).to_have_count(0)
    assert patient_http.get(f"{server}/v1/jobs/{ended['id']}").status_code == 404
    for job in (clone, again):
        stop(server, job)


TINY = {"total_steps": 1280, "n_envs": 128, "learning_starts": 0, "progress_steps": 128}
"""A training of seconds with ten points."""


def test_jobs_are_compared_with_a_band_over_seeds(
    open_page: Callable[..., Page], server: str
) -> None:
    changes: tuple[tuple[int, dict[str, float]], ...] = ((1, {}), (2, {}), (1, {"gamma": 0.9}))
    made = [
        patient_http.post(
            f"{server}/v1/jobs",
            json={
                "kind": "train",
                "preset": "pick-td3",
                "seed": seed,
                "overrides": {"learning": {**TINY, **own}},
            },
        ).json()
        for seed, own in changes
    ]
    for job in made:  # each stream ends with its job
        patient_http.get(f"{server}/v1/jobs/{job['id']}/events")
    page = open_page((1280, 900), scene=False)
    page.click("#tab-training")
    page.locator('[data-action="compare"]').press("Enter")
    expect(page.locator('[data-action="show-comparison"]')).to_be_disabled()
    expect(page.locator("#jobs-title")).to_be_focused()
    for job in made:
        page.check(f'[data-job="{job["id"]}"] [data-role="compare"]')
    page.click('[data-action="show-comparison"]')
    dialog = page.locator('[data-role="comparison"]')
    page.select_option('[data-role="quantity"]', "updates")
    groups = dialog.locator('[data-role="groups"] li')
    expect(groups).to_have_count(2)
    expect(groups.first).to_contain_text("seeds 1, 2")
    expect(groups.last).to_contain_text("Discount factor γ = 0.9")
    fields = dialog.locator('[data-role="differences"] tbody th')
    expect(fields).to_contain_text(["Discount factor γ [per step]", "Seed"])
    expect(fields.locator("code")).to_have_text(["learning.gamma"])
    with page.expect_download() as table:
        dialog.get_by_text("CSV").click()
    rows = Path(table.value.path()).read_text().splitlines()
    assert len(rows) == 31 and rows[0].startswith("job,number,name,preset,seed,step,")
    with page.expect_download() as picture:
        dialog.locator('[data-action="png"]').click()
    assert Path(picture.value.path()).read_bytes().startswith(b"\x89PNG")
    assert page.problems == []  # type: ignore[attr-defined]


def test_groups_of_a_comparison_look_different(
    open_page: Callable[..., Page], ended: dict[str, Any]
) -> None:
    jobs = [{**ended, "id": f"job-{n}", "number": n} for n in range(20)]
    curve = {"mean": [0.1, 0.5], "low": [0.1, 0.5], "high": [0.1, 0.5], "n": [1, 1]}
    groups = [{"label": "", "jobs": [job["id"]], **curve} for job in jobs]
    rates = {"quantity": "success", "quantities": ["success"], "steps": [0, 100]}
    answer = {"jobs": jobs, "groups": groups, "differences": [], **rates}
    page = open_page((1280, 900), scene=False)
    page.route("**/v1/comparison?*", lambda route: route.fulfill(json=answer))
    page.click("#tab-training")
    page.click('[data-action="compare"]')
    page.check(f'[data-job="{ended["id"]}"] [data-role="compare"]')
    page.click('[data-action="show-comparison"]')
    marks = page.locator('[data-role="groups"] .line-mark')
    expect(marks).to_have_count(20)
    looks = marks.evaluate_all("all => all.map((one) => getComputedStyle(one).background)")
    assert len(set(looks)) == 20


def cancel(page: Page) -> None:
    page.get_by_role("button", name="Cancel …").click()
    page.get_by_role("button", name="Cancel the job").click()
    expect(page.locator(".job.is-open")).to_have_attribute("data-state", "cancelled")


def test_bad_input_is_explained_at_its_field(open_page: Callable[..., Page]) -> None:
    page = open_page(scene=False)
    open_form(page)
    page.fill("#train-seed", "minus one")
    page.click("form.train button[type=submit]")
    expect(page.locator("#train-seed")).to_have_attribute("aria-invalid", "true")
    expect(page.locator("#train-seed-error")).to_contain_text("integer")
    expect(page.locator("#train-seed")).to_be_focused()
    page.fill("#train-seed", "1")
    expect(page.locator("#train-seed-error")).to_have_count(0)
    expect(page.locator("#train-seed")).to_have_attribute("aria-invalid", "false")


def test_page_and_evaluations_take_the_same_intervals(open_page: Callable[..., Page]) -> None:
    page = open_page(scene=False)
    code = "([rate, n]) => import('/static/format.js').then((one) => one.wilson(rate, n))"
    for hits, n in ((0, 14), (9, 14), (14, 14), (986, 1000)):
        assert page.evaluate(code, [hits / n, n]) == pytest.approx(wilson(hits, n))


def test_error_of_a_field_stays_while_another_is_edited(open_page: Callable[..., Page]) -> None:
    page = open_page(scene=False)
    open_form(page)
    page.fill("#train-seed", "x")
    page.click("form.train summary")
    page.click("form.train button[type=submit]")
    expect(page.locator("#train-seed-error")).to_be_visible()
    page.fill("#train-learning-progress_steps", "5120")
    expect(page.locator("#train-seed-error")).to_be_visible()


def test_evaluation_is_shown_with_its_intervals(
    open_page: Callable[..., Page], server: str
) -> None:
    body = {"kind": "evaluate", "protocol": "pick-single", "episodes": 40, "seed": 3}
    posted = patient_http.post(f"{server}/v1/jobs", json=body)
    assert posted.status_code == 202, posted.text
    page = open_page(scene=False)
    page.click("#tab-training")
    rows = page.locator(f'[data-job="{posted.json()["id"]}"] [data-role="rows"]')
    expect(rows).to_contain_text("n = 40")
    result = patient_http.get(f"{server}/v1/jobs/{posted.json()['id']}").json()["result"]
    success = result["results"][0]["success"]
    low, high = (f"{100 * success[end]:.1f}" for end in ("low", "high"))
    interval = f"{100 * success['mean']:.1f} % ({low} to {high})"
    expect(rows).to_contain_text(interval)
    for alias in ("pick", "reach"):
        card = page.locator(f'[data-checkpoint="{pretrained.SHA256[alias]}"]')
        card.locator(".job-head").click()
        card.locator("[data-action=compare-checkpoint]").check()
    compared = page.locator("[data-role=checkpoint-differences]")
    expect(compared).to_contain_text("Success in pick-single: ")
    expect(compared).to_contain_text(interval)


def test_evaluation_of_another_protocol_shows_its_own_measures(
    open_page: Callable[..., Page], server: str
) -> None:
    body = {"kind": "evaluate", "protocol": "risk-calibration", "episodes": 4, "seed": 3}
    posted = patient_http.post(f"{server}/v1/jobs", json=body)
    assert posted.status_code == 202, posted.text
    page = open_page(scene=False)
    page.click("#tab-training")
    rows = page.locator(f'[data-job="{posted.json()["id"]}"] [data-role="rows"]')
    expect(rows).to_contain_text("n = 4")
    result = patient_http.get(f"{server}/v1/jobs/{posted.json()['id']}").json()["result"]
    contact = result["results"][0]["contact"]
    for label, value in (("observed", contact["rate"]), ("predicted", contact["mean"])):
        expect(rows).to_contain_text(f"contact, {label}{100 * value:.1f}\N{NO-BREAK SPACE}%")
    expect(rows).not_to_contain_text("NaN")


def test_override_out_of_range_is_explained_at_its_field(
    open_page: Callable[..., Page], server: str
) -> None:
    def posted() -> list[str]:
        return [job["id"] for job in patient_http.get(f"{server}/v1/jobs").json()["items"]]

    preset = patient_http.get(f"{server}/v1/presets").json()["items"][0]
    field = next(f for f in preset["fields"] if f["maximum"] is not None)
    page, before = open_page(scene=False), posted()
    open_form(page)
    page.evaluate("document.querySelectorAll('form.train details').forEach(d => d.open = true)")
    group, name = field["name"].split(".")
    page.fill(f"#train-{group}-{name}", str(int(field["maximum"]) + 1000))
    page.click("form.train button[type=submit]")
    expect(page.locator(f"#train-{group}-{name}-error")).not_to_be_empty()
    assert posted() == before
