"""Pages of one browser share six connections to a server: none is kept that nobody needs."""

from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, Route, expect

from tests.browser.conftest import free_port, serving
from tests.browser.test_drag import tell

pytestmark = pytest.mark.browser

UP = '{ from: "tandem-scene", state: "up", reason: "" }'
EVENTS = "**/v1/worlds/main/events"
SEE = """hidden => {
  Object.defineProperty(document, "hidden", { configurable: true, get: () => hidden });
  document.dispatchEvent(new Event("visibilitychange"));
}"""
"""Headless Chromium hides no page: the browser's own notice is given by hand."""
LINKS = """() => {
  const frame = document.querySelector(".frame"), links = [frame.dataset.link];
  new MutationObserver(() => links.push(frame.dataset.link))
    .observe(frame, { attributes: true });
  window.links = links;
}"""
"""Collects the states of the link from now on."""


def test_hidden_page_closes_its_stream_and_is_present_again_when_seen(
    open_page: Callable[..., Page], server: str
) -> None:
    page = open_page(scene=False)
    frame = page.locator('[data-role="viewer"]').element_handle()
    inside = frame.content_frame()
    assert inside is not None
    inside.evaluate(f"parent.postMessage({UP}, location.origin)")
    expect(page.locator('[data-role="viewer"]')).to_have_attribute("data-state", "up")
    with page.expect_event("requestfailed", lambda one: one.url.endswith("/main/events")):
        page.evaluate(SEE, True)
    expect(page.locator("[data-link]")).to_have_attribute("data-link", "live")
    tell(server, {"tag": "set-candidates", "ids": ["cube2"]})
    with page.expect_request(EVENTS):
        page.evaluate(SEE, False)
    expect(page.locator('[data-goal="cube2"]')).to_have_attribute("aria-pressed", "true")
    expect(page.locator('[data-goal="cube1"]')).to_have_attribute("aria-pressed", "false")
    assert frame.evaluate("one => one.isConnected"), "the scene was loaded again"
    tell(server, {"tag": "set-candidates", "ids": ["cube1", "cube2"]})
    expect(page.locator('[data-goal="cube1"]')).to_have_attribute("aria-pressed", "true")


def test_slow_server_is_asked_for_jobs_once_at_a_time(open_page: Callable[..., Page]) -> None:
    page = open_page(scene=False)
    held: list[Route] = []
    page.route("**/v1/jobs?part_of=none&limit=50", lambda route: held.append(route))
    page.wait_for_timeout(6500)
    assert len(held) == 1
    page.unroute("**/v1/jobs?part_of=none&limit=50")
    held[0].continue_()
    with page.expect_response("**/v1/jobs?part_of=none&limit=50"):
        pass


def test_refusals_stay_when_another_command_succeeds(open_page: Callable[..., Page]) -> None:
    page = open_page(scene=False)
    refusals = iter([{"detail": "cube1 is refused"}, {"detail": "cube2 is refused"}])

    def answer(route: Route) -> None:
        body = next(refusals, None)
        if body is None:
            route.continue_()
        else:
            route.fulfill(status=422, json=body)

    page.route("**/v1/worlds/main/commands", answer)
    page.evaluate(
        """() => ["cube1", "cube2", "dock1"].forEach((id) =>
          document.querySelector(`[data-goal=${id}]`).click())"""
    )
    pressed = page.locator('[data-goal="dock1"]').get_attribute("aria-pressed")
    expect(page.locator('[data-role="link"]')).to_have_attribute("data-pending", "0")
    for name in ("cube1", "cube2"):
        expect(page.locator(".banner.bad")).to_contain_text(f"{name} is refused")
    page.click('[data-goal="dock1"]')
    expect(page.locator('[data-goal="dock1"]')).to_have_attribute("aria-pressed", str(pressed))
    expect(page.locator(".banner.bad")).to_have_count(0)


def test_sign_in_form_sends_its_token_once(browser: Browser, server: str) -> None:
    page = browser.new_page()
    needs = {"detail": "the server requires its token"}
    page.route("**/v1/worlds/main", lambda route: route.fulfill(status=401, json=needs))
    page.goto(server)
    page.fill("#token", "a-token-of-some-length")
    sent: list[str] = []
    page.on("request", lambda one: sent.append(one.url) if one.method == "POST" else None)
    with page.expect_navigation():
        page.evaluate(
            """() => [1, 2].forEach(() =>
              document.querySelector(".signin form").requestSubmit())"""
        )
    assert sent == [f"{server}/session"]
    page.close()


def test_page_names_a_cell_that_has_stopped_and_starts_it_again(
    open_page: Callable[..., Page], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hang = tmp_path / "hang"
    monkeypatch.setenv("HANG_FILE", str(hang))
    module = "tests.support.stalling_server"
    with serving(tmp_path, free_port(), module) as (address, _):
        page = open_page(scene=False, address=address)
        hang.touch()
        banner = page.locator('[data-role="stale"]')
        expect(banner).to_contain_text("The server sends nothing.")
        expect(banner).to_contain_text("The server answers, but the cell has stopped.")
        page.evaluate(LINKS)
        page.click("#tab-training")
        page.wait_for_timeout(14_000)
        assert set(page.evaluate("() => window.links")) == {"stalled"}
        expect(page.locator("#panel-training")).to_contain_text("No jobs yet")
        banner.get_by_role("button", name="Start the cell again").click()
        page.wait_for_selector('[data-link="live"]')
        expect(banner).to_have_count(0)
        hang.unlink()


def test_effect_of_a_command_is_unknown_after_a_lost_connection(
    open_page: Callable[..., Page],
) -> None:
    page = open_page(scene=False)
    unseen = {"number": 10**9}
    page.route("**/v1/worlds/main/commands", lambda route: route.fulfill(json=unseen))
    page.click('[data-goal="cube2"]')
    page.wait_for_selector('[data-role="link"][data-pending="1"]')
    page.evaluate(SEE, True)
    unknown = page.locator(".banner.bad")
    expect(unknown).to_contain_text("Effect unknown: toggle candidate.")
    with page.expect_request(EVENTS):
        page.evaluate(SEE, False)
    expect(unknown).to_contain_text("look at the cell again")
