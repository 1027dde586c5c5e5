"""Dashed arc from the position of an object to its target."""

import numpy as np
import viser

from app.sim.cells.colours import TARGET
from app.sim.core.arrays import Vec

N_STROKES = 14


class Arc:
    """One dashed arc; used by the live cell's thread only.

    Args:
        lift: Greatest height over the straight line [m].
    """

    def __init__(self, server: viser.ViserServer, name: str, lift: float) -> None:
        self._lift = lift
        self._lines = server.scene.add_line_segments(
            name, np.zeros((N_STROKES, 2, 3)), TARGET, thickness=0.006, visible=False
        )
        self._key: tuple[object, ...] = ()

    def hide(self) -> None:
        """Hide the arc."""
        self._lines.visible = False

    def show(self, start: Vec, end: Vec) -> None:
        """Draw it from ``start`` to ``end`` [m], shape (3,)."""
        self._lines.visible = True
        key = (*np.round(start, 3).tolist(), *np.round(end, 3).tolist())
        if key != self._key:
            self._key = key
            self._lines.points = dashes(start, end, self._lift).astype(np.float32)


def dashes(start: Vec, end: Vec, lift: float) -> Vec:
    """Return the dashes of an arc from ``start`` to ``end`` [m], shape (N_STROKES, 2, 3).

    Args:
        start: Its beginning [m], shape (3,).
        end: Its end [m], shape (3,).
        lift: Greatest height over the straight line [m]; less where the ends are near.
    """
    ends = (np.arange(N_STROKES)[:, None] + np.array([0.15, 0.75])) / N_STROKES
    line = start + ends[..., None] * (end - start)
    lift = min(lift, 0.35 * float(np.linalg.norm(end - start)))
    line[..., 2] += 4.0 * lift * ends * (1.0 - ends)
    return np.asarray(line)
