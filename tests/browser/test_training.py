"""A visitor starts a training job on the page and watches it learn."""

from collections.abc import Callable

import pytest
from playwright.sync_api import Page, expect

from tests import patient_http

pytestmark = pytest.mark.browser

GROWTH_MS = 240_000
"""Time for a job to start its process, warm up and report several points [ms]."""
FINE = {"progress_steps": 5120, "checkpoint_steps": 5120}
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
    for name, value in FINE.items():
        page.fill(f"#train-{name}", str(value))
    page.click("form.train button[type=submit]")
    job_id = page.get_attribute(".job.is-open", "data-job")
    page.wait_for_selector("[data-points]", timeout=GROWTH_MS)
    seen = points(page)
    page.wait_for_function(
        "n => Number(document.querySelector('[data-points]').dataset.points) >= n + 2",
        arg=seen,
        timeout=GROWTH_MS,
    )
    stored = patient_http.get(f"{server}/v1/jobs/{job_id}/metrics").json()["items"]
    steps = [row["step"] for row in stored]
    assert steps == sorted(set(steps))
    assert len(steps) >= seen + 2
    job = patient_http.get(f"{server}/v1/jobs/{job_id}").json()
    assert (job["seed"], job["overrides"]) == (7, FINE)
    cancel(page)
    assert page.problems == []  # type: ignore[attr-defined]


def cancel(page: Page) -> None:
    page.get_by_role("button", name="Cancel …").click()
    page.get_by_role("button", name="Cancel the job").click()
    expect(page.locator(".job.is-open")).to_have_attribute(
        "data-state", "cancelled", timeout=GROWTH_MS
    )


def test_bad_input_is_explained_at_its_field(open_page: Callable[..., Page]) -> None:
    page = open_page(scene=False)
    open_form(page)
    page.fill("#train-seed", "minus one")
    page.click("form.train button[type=submit]")
    expect(page.locator("#train-seed")).to_have_attribute("aria-invalid", "true")
    expect(page.locator("#train-seed-error")).to_contain_text("integer")
    expect(page.locator("#train-seed")).to_be_focused()


def test_override_out_of_range_is_explained_at_its_field(
    open_page: Callable[..., Page], server: str
) -> None:
    preset = patient_http.get(f"{server}/v1/presets").json()["items"][0]
    field = next(f for f in preset["fields"] if f["maximum"] is not None)
    page = open_page(scene=False)
    open_form(page)
    page.evaluate("document.querySelectorAll('form.train details').forEach(d => d.open = true)")
    page.fill(f"#train-{field['name']}", str(int(field["maximum"]) + 1000))
    page.click("form.train button[type=submit]")
    expect(page.locator(f"#train-{field['name']}-error")).not_to_be_empty()
    jobs = patient_http.get(f"{server}/v1/jobs").json()["items"]
    assert all(field["name"] not in job["overrides"] for job in jobs)
