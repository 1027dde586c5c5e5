"""Risk map in the scene: probability of contact over positions of a person."""

import numpy as np
import viser
from numpy.typing import NDArray

from app.live.pick.risk_worker import GRID, PersonRisk
from app.live.status_messages import percent_text

NODE = "/risk"
HEIGHT_M = 0.004
"""Height over the table [m]."""
ENDS = (0.0, 0.4)
"""Probabilities at the ends of the colour scale."""
COLOURS = np.array([(56, 158, 98), (240, 196, 66), (206, 56, 46)], dtype=np.float64)
"""Colours of the scale, equally spaced."""
ALPHA = 150
NOTHING = (120, 124, 130, 90)
"""Colour of positions at which robot and person touch."""
BAR_M = (0.8, 0.04)
"""Length and width of the legend [m]."""


def colours_of(probability: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return colours with opacity, shape (..., 4), of probabilities, shape (...,)."""
    at = np.interp(probability, ENDS, (0.0, len(COLOURS) - 1.0))
    shares = [np.interp(at, range(len(COLOURS)), COLOURS[:, k]) for k in range(3)]
    return np.stack([*shares, np.full(at.shape, ALPHA)], axis=-1).round().astype(np.uint8)


class RiskView:
    """Draws the map over table and floor; used by the live cell's thread only."""

    def __init__(self, server: viser.ViserServer) -> None:
        (x0, x1), (y0, y1) = GRID.x[[0, -1]].tolist(), GRID.y[[0, -1]].tolist()
        cell = GRID.x[1] - GRID.x[0], GRID.y[1] - GRID.y[0]
        middle = 0.5 * (y0 + y1)
        self._image = server.scene.add_image(
            f"{NODE}/map",
            np.zeros((*GRID.shape, 4), dtype=np.uint8),
            x1 - x0 + cell[0],
            y1 - y0 + cell[1],
            format="png",
            cast_shadow=False,
            receive_shadow=False,
            position=(0.5 * (x0 + x1), middle, HEIGHT_M),
        )
        length, width = BAR_M
        server.scene.add_image(
            f"{NODE}/scale",
            colours_of(np.linspace(*ENDS, 32)[None]),
            length,
            width,
            format="png",
            cast_shadow=False,
            receive_shadow=False,
            position=(x1 - 0.5 * length, y0 - 0.12, HEIGHT_M),
        )
        low, high = (percent_text(end) for end in ENDS)
        labels = [
            server.scene.add_label(
                f"{NODE}/scale/{share + 0.5}",
                text,
                position=(share * length, -0.08, 0.0),
                anchor="center-center",
                font_screen_scale=0.8,
            )
            for share, text in ((-0.5, low), (0.0, "P(contact)"), (0.5, f"{high} or more"))
        ]
        self._title = labels[1]
        self._shown: PersonRisk | None = None

    def draw(self, found: PersonRisk | None) -> None:
        """Show a map; sends nothing if it is shown already."""
        if found is self._shown:
            return
        self._shown = found
        if found is None or found.map.contact is None:
            self._image.image = np.zeros((*GRID.shape, 4), dtype=np.uint8)
            return
        self._title.text = f"P(contact), person {found.person + 1} there"
        picture = colours_of(found.map.contact)
        picture[found.map.clearance_m <= 0.0] = NOTHING
        self._image.image = picture.reshape(*GRID.shape, 4)
