"""Take the pictures of the page that the documents show, from a server that runs.

    python -m tools.docs.screenshots http://127.0.0.1:8000

Writes ``docs/img/scene.png`` and ``sorting.png``: the live cells with people
after half a minute, paused while the robot moves. Changes the live world of that server. Needs
Chromium, which draws the scene in software: about two minutes on two free cores.
"""

import shutil
from typing import NamedTuple

from playwright.sync_api import Page, ViewportSize, sync_playwright

from tools.arguments import parser_of
from tools.docs.results import IMAGES

FLAGS = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader")
SIZE = ViewportSize(width=1440, height=900)
PATIENCE_MS = 180_000
RUN_MS = 30_000
"""Time that a cell runs before its picture: the plots show the last 20 s."""
MOVING = 0.3
"""Least speed override of a picture, so that it does not show a stopped robot."""
LOOKS, LOOK_MS = 300, 200
"""Most times to look for such a moment, and the time between them; the last one is taken."""
STILL_MS = 8_000
"""Time for the scene to draw the paused cell."""


class Picture(NamedTuple):
    """A picture of a live cell."""

    cell: str
    file: str
    begin: dict[str, str]
    """Command that gives the cell something to show."""


PICTURES = (
    Picture("sorting-e0", "sorting.png", {"tag": "start-test", "id": "test-5"}),
    Picture("pick-and-place", "scene.png", {"tag": "add-person"}),
)


def take(page: Page, address: str, picture: Picture) -> None:
    """Show a cell, let it run, pause it and write its picture."""
    page.select_option("[data-role=cell]", picture.cell)
    while page.request.get(f"{address}/v1/worlds/main").json()["cell"] != picture.cell:
        page.wait_for_timeout(500)
    page.wait_for_timeout(STILL_MS)
    page.wait_for_selector('[data-role="viewer"][data-state="up"]')
    for body in ({"tag": "resume"}, picture.begin):
        _command(page, address, body)
    page.wait_for_timeout(RUN_MS)
    for _ in range(LOOKS):
        world = page.request.get(f"{address}/v1/worlds/main").json()
        if world["safety"]["override"] >= MOVING:
            break
        page.wait_for_timeout(LOOK_MS)
    _command(page, address, {"tag": "pause"})
    page.wait_for_timeout(STILL_MS)
    page.screenshot(path=IMAGES / picture.file)
    _command(page, address, {"tag": "resume"})


def _command(page: Page, address: str, body: dict[str, str]) -> None:
    answer = page.request.post(f"{address}/v1/worlds/main/commands", data=body)
    if not answer.ok:
        raise SystemExit(f"{body['tag']}: {answer.text()}")


def main() -> None:
    """Take every picture."""
    parser = parser_of(__doc__)
    parser.add_argument("address", help="address of a server without access control")
    address = parser.parse_args().address.rstrip("/")
    path = shutil.which("chromium") or shutil.which("google-chrome")
    with sync_playwright() as driver:
        page = driver.chromium.launch(executable_path=path, args=FLAGS).new_page(viewport=SIZE)
        page.set_default_timeout(PATIENCE_MS)
        page.goto(address)
        page.get_by_role("button", name="Do not show this again").click()
        for picture in PICTURES:
            take(page, address, picture)


if __name__ == "__main__":
    main()
