"""Colours between given ones, in proportion to a value."""

import numpy as np

from web.viewer.people.mannequin import Rgb

ColorScale = tuple[tuple[float, Rgb], ...]
"""Ascending values, each with its colour."""


def blend(scale: ColorScale, x: float) -> Rgb:
    """Return the colour of ``x``, that of the nearest end beyond the scale."""
    places = [at for at, _ in scale]
    channels = [np.interp(x, places, [color[k] for _, color in scale]) for k in range(3)]
    return round(float(channels[0])), round(float(channels[1])), round(float(channels[2]))
