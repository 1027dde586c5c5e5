"""A real server process and a real Chromium, for the tests that act as a visitor does."""

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest
from playwright.sync_api import Browser, ConsoleMessage, Page, Request, expect, sync_playwright

from tests.support import patient_http

ROOT = Path(__file__).parents[2]
LIMIT_S = 900.0
"""Time that anything may take, far above what it takes; only a hang reaches it. Software draws
3 to 12 pictures per second, and jobs have a lower priority than it [s]."""
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]

FEW_PICTURES = """if (location.pathname.includes("/viewer/")) {
  const context = WebGL2RenderingContext.prototype, frame = window.requestAnimationFrame;
  let last = -Infinity, skips = false;
  for (const name of ["drawArrays", "drawArraysInstanced", "drawElements",
                      "drawElementsInstanced"]) {
    const draw = context[name];
    context[name] = function (...all) { return skips ? undefined : draw.apply(this, all); };
  }
  window.requestAnimationFrame = (act) => frame.call(window, (now) => {
    if (now - last >= 10000) last = now;
    skips = now !== last;
    act(now);
  });
}"""
"""Lets Chromium draw the scene's pictures every 10 s. The viewer still makes all its calls, but
software needs 0.3 s of a core for each picture and draws without a pause."""

OpenPage = Callable[..., Page]


@pytest.fixture(scope="session")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Run ``python -m app serve`` with fresh data; yields its address once it is ready.

    While working on the page, ``BROWSER_TEST_SERVER=http://127.0.0.1:8000`` names a server that
    runs already.
    """
    running = os.environ.get("BROWSER_TEST_SERVER")
    if running:
        yield running
        return
    with serving(tmp_path_factory.mktemp("tandem"), free_port()) as (address, _):
        yield address


@contextmanager
def serving(
    data: Path, port: int, module: str = "app"
) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Start a server process, wait until it is ready, and stop it in the end.

    Yields its address and the process, which may have been killed by then.

    Args:
        data: Its data folder.
        port: The port it listens on.
        module: The module whose command ``serve`` it runs.
    """
    env = os.environ | {"TANDEM_DATA": str(data), "TANDEM_PORT": str(port)}
    log = data / "server.log"
    with log.open("wb") as sink:
        process = subprocess.Popen(
            [sys.executable, "-m", module, "serve"],
            cwd=ROOT,
            env=env,
            stdout=sink,
            stderr=subprocess.STDOUT,
        )
        try:
            address = f"http://127.0.0.1:{port}"
            wait_until_ready(address, process, log)
            yield address, process
        finally:
            process.send_signal(signal.SIGCONT)
            process.terminate()
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def wait_until_ready(address: str, process: subprocess.Popen[bytes], log: Path) -> None:
    """Ask ``/readyz`` until it answers 200; fail with the server's log otherwise."""
    end = time.monotonic() + LIMIT_S
    while time.monotonic() < end and process.poll() is None:
        try:
            if patient_http.get(f"{address}/readyz").status_code == 200:
                return
        except httpx.TransportError:
            pass
        time.sleep(0.5)
    pytest.fail(f"the server did not become ready:\n{log.read_text()[-4000:]}")


def show(server: str, cell: str) -> None:
    """Let the live world of a server be that of another cell."""
    answer = patient_http.put(f"{server}/v1/worlds/main/cell", json={"cell": cell})
    assert answer.status_code == 200, answer.text


def free_port() -> int:
    """Return a port nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Start the system's Chromium, headless, with software rendering."""
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    path = path or shutil.which("google-chrome")
    if path is None:
        pytest.fail("no chromium, chromium-browser or google-chrome on PATH")
    with sync_playwright() as driver:
        running = driver.chromium.launch(executable_path=path, args=FLAGS)
        yield running
        running.close()


@pytest.fixture
def open_page(browser: Browser, server: str) -> Iterator[OpenPage]:
    """Open Tandem's page as a visitor; ``page.problems`` lists what went wrong on it.

    The clock of the live cell runs again after the test.

    Software takes long to draw the scene, in the page's own thread: a test that does not look
    at it leaves it out with ``scene=False``.
    """
    pages: list[Page] = []
    expect.set_options(timeout=1e3 * LIMIT_S)

    def open_it(
        size: tuple[int, int] = (1024, 700), *, scene: bool = True, address: str = server
    ) -> Page:
        page = browser.new_page(viewport={"width": size[0], "height": size[1]})
        page.set_default_timeout(1e3 * LIMIT_S)
        page.add_init_script(FEW_PICTURES)
        pages.append(page)
        problems: list[str] = []
        page.problems = problems  # type: ignore[attr-defined]
        page.on("console", lambda message: problems.extend(complaint(message)))
        page.on(
            "pageerror", lambda error: problems.append(f"page error: {error.stack or error}")
        )
        page.on("requestfailed", lambda request: problems.extend(lost(request)))
        if not scene:
            page.route(
                "**/viewer/**", lambda route: route.fulfill(body="", content_type="text/html")
            )
        page.goto(address)
        page.wait_for_selector('[data-link="live"]')
        return page

    yield open_it
    for page in pages:
        page.close()
    commands = f"{server.rstrip('/')}/v1/worlds/main/commands"
    patient_http.post(commands, json={"tag": "resume"}).raise_for_status()


def complaint(message: ConsoleMessage) -> list[str]:
    """Return a console message that a visitor's browser should never show."""
    if message.type != "error":
        return []
    return [f"{message.text} ({message.location.get('url', '')})"]


def lost(request: Request) -> list[str]:
    """Return a request that got no answer, unless the page itself let go of it."""
    failure = request.failure or ""
    return [] if "ERR_ABORTED" in failure else [f"{request.url}: {failure}"]
