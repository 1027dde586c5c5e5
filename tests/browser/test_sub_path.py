"""The page behind a reverse proxy that shows it below a path: nothing leads out of the path."""

from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.conftest import free_port, serving
from tests.support import patient_http
from tests.support.sub_path_proxy import PREFIX, below_path

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def outside_paths() -> list[str]:
    """Paths outside the proxy's that were asked for."""
    return []


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory, outside_paths: list[str]) -> Iterator[str]:
    """Run a server below a path; yields the address of its page."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TANDEM_ROOT_PATH", PREFIX)
        with (
            serving(tmp_path_factory.mktemp("below"), free_port()) as (address, _),
            below_path(address, outside_paths) as shown,
        ):
            yield f"{shown}/"


def test_page_scene_and_commands_work_below_a_path(
    open_page: Callable[..., Page], server: str, outside_paths: list[str]
) -> None:
    page = open_page()
    page.frame_locator('[data-role="viewer"]').locator("canvas").first.wait_for()
    page.click('[data-action="pause"]')
    expect(page.locator(".story .chip").first).to_have_text("Paused")
    assert patient_http.get(f"{server}v1/worlds/main").json()["paused"]
    page.click("#tab-training")
    page.wait_for_selector("#jobs-title")
    page.reload()
    page.wait_for_selector('[data-link="live"]')
    with page.expect_navigation():
        page.click("a.docs")
    assert page.url == f"{server}docs"
    assert page.problems == []  # type: ignore[attr-defined]
    assert outside_paths == []
