"""The scene on a page: whether it draws, where its points are, and the mouse on its handles.

The viewer draws with a perspective camera whose field of view is the vertical one and whose
picture fills the canvas; nothing else is needed to aim a mouse at a handle in the scene.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from playwright.sync_api import Error, Frame, Page, TimeoutError

from app.sim.cells.cell import Cell
from web.viewer.scene import workplace
from web.viewer.server import ViewerServer

VIEWER = '[data-role="viewer"]'
UP = f'{VIEWER}[data-state="up"]'
ATTEMPTS = 5
TRIES, MOVES = 5, 10
FOLLOWED_M = 0.02
"""How far a handle that follows the mouse goes at least."""
REST_MS = 500
STILL_M = 1e-4
NEXT_PICTURE = """() => new Promise((resolve) => {
  const draw = WebGL2RenderingContext.prototype.drawElements;
  WebGL2RenderingContext.prototype.drawElements = function (...all) {
    WebGL2RenderingContext.prototype.drawElements = draw;
    resolve();
    return draw.apply(this, all);
  };
})"""
"""Resolves in a frame when it draws next."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Camera:
    """A camera of the scene, drawing on a canvas of the page."""

    position: tuple[float, float, float]
    """Where it is, world frame [m]."""
    look_at: tuple[float, float, float]
    """The point in the middle of the picture [m]."""
    fov: float
    """Vertical field of view [rad]."""
    left: float = 0.0
    """Left edge of the canvas on the page [px]."""
    top: float = 0.0
    """Upper edge of the canvas on the page [px]."""
    width: float = 1.0
    """Width of the canvas [px]."""
    height: float = 1.0
    """Height of the canvas [px]."""

    def project(self, point: ArrayLike) -> tuple[float, float]:
        """Return the page coordinates [px] of a point of the world [m]."""
        forward = _unit(np.subtract(self.look_at, self.position))
        right = _unit(np.cross(forward, (0.0, 0.0, 1.0)))
        up = np.cross(right, forward)
        ray = np.subtract(point, self.position)
        half = float(ray @ forward) * np.tan(0.5 * self.fov) * 2.0 / self.height
        x = self.left + 0.5 * self.width + float(ray @ right) / half
        y = self.top + 0.5 * self.height - float(ray @ up) / half
        return x, y


def _unit(vector: ArrayLike) -> np.ndarray:
    return np.asarray(vector) / np.linalg.norm(vector)


def scene_of(page: Page) -> Frame:
    """Return the frame of the scene once it has drawn."""
    page.wait_for_selector(UP)
    return next(one for one in page.frames if "/viewer/" in one.url)


def expect_drawing(page: Page) -> None:
    """Wait until the scene draws another picture; another cell loads it again meanwhile."""
    for _ in range(ATTEMPTS):
        try:
            scene_of(page).evaluate(NEXT_PICTURE)
        except (Error, StopIteration) as error:
            if isinstance(error, TimeoutError):
                raise
            page.wait_for_timeout(1000)
            continue
        return
    raise AssertionError("the scene does not stay")


def drag_along(
    page: Page, cell: Cell, where: Callable[[], np.ndarray], offset: np.ndarray, grip_m: float
) -> None:
    """Drag the arrow of a handle along one axis.

    A mouse that misses the arrow, because the scene is not complete, turns the camera
    instead: the page is loaded again then, which brings the first camera back.

    Args:
        page: A page that shows the cell with its first camera.
        cell: The cell.
        where: Returns where the handle is, as the service says [m].
        offset: How far the mouse goes [m], (3,), along one axis.
        grip_m: Where along the arrow the mouse takes it [m].

    Raises:
        AssertionError: The handle never followed.
    """
    camera = first_camera(cell)
    for _ in range(TRIES):
        expect_drawing(page)
        start = at_rest(page, where)
        grip = start + grip_m * np.abs(np.sign(offset))
        view = on_canvas(page, camera)
        (x0, y0), (x1, y1) = view.project(grip), view.project(grip + offset)
        page.mouse.move(x0, y0)
        page.wait_for_timeout(400)
        page.mouse.down()
        for share in np.linspace(1 / MOVES, 1.0, MOVES):
            page.mouse.move(x0 + share * (x1 - x0), y0 + share * (y1 - y0))
            page.wait_for_timeout(120)
        page.mouse.up()
        if np.abs(at_rest(page, where) - start).max() > FOLLOWED_M:
            return
        page.reload()
        page.wait_for_selector('[data-link="live"]')
        page.frame_locator(VIEWER).locator("canvas").first.wait_for()
        page.wait_for_timeout(2000)
    raise AssertionError("the handle does not follow the mouse")


def at_rest(page: Page, where: Callable[[], np.ndarray]) -> np.ndarray:
    """Return where a handle is as soon as it stands still [m], (3,)."""
    before = where()
    for _ in range(100):
        page.wait_for_timeout(REST_MS)
        now = where()
        if np.abs(now - before).max() < STILL_M:
            return now
        before = now
    raise AssertionError("the handle does not come to rest")


def first_camera(cell: Cell) -> Camera:
    """Return the camera every visitor of a cell starts with, from a scene of its own."""
    server = ViewerServer()
    workplace.build(server, cell)
    first = server.initial_camera
    camera = Camera(
        position=tuple(first.position), look_at=tuple(first.look_at), fov=float(first.fov)
    )
    server.stop()
    return camera


def on_canvas(page: Page, camera: Camera) -> Camera:
    """Return the camera as it draws on this page now."""
    box = page.frame_locator(VIEWER).locator("canvas").first.bounding_box()
    assert box is not None
    x, y, width, height = (box[side] for side in ("x", "y", "width", "height"))
    return replace(camera, left=x, top=y, width=width, height=height)
