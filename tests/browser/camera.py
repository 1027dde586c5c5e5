"""Where a point of the scene stands on the screen: the viewer's pinhole camera.

The viewer draws with a perspective camera whose field of view is the vertical one and whose
picture fills the canvas; nothing else is needed to aim a mouse at a handle in the scene.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


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
