"""Colours of the bodies of a cell, in images of environments and in the 3D scene.

``web/page/palette.js`` repeats those of vests, blocks and failure probabilities.
"""

import numpy as np

Rgb = tuple[int, int, int]
"""A colour, sRGB, 0 to 255."""
ColourScale = tuple[tuple[float, Rgb], ...]
"""Ascending values, each with its colour."""

TABLE_TOP: Rgb = (236, 233, 226)
TABLE_EDGE: Rgb = (172, 142, 108)
TABLE_FRAME: Rgb = (178, 184, 191)
ROBOT_PLATE: Rgb = (96, 103, 112)
OBSTACLE: Rgb = (150, 158, 168)
ALUMINIUM: Rgb = (205, 209, 214)
"""Colour of the robot's links."""
JOINT: Rgb = (88, 152, 196)
"""Colour of the caps of the robot's joints."""
TOOL: Rgb = (255, 138, 52)
TARGET: Rgb = (11, 127, 119)
"""Colour of the selected target and of the motion to it."""
TRAY: Rgb = (206, 210, 214)
"""Colour of the plate under clutter slots."""
BLOCKS: dict[str, Rgb] = {"red": (205, 58, 62), "green": (112, 184, 92), "blue": (52, 104, 196)}
"""Colour of blocks and towers by name."""
FAILURES: ColourScale = (
    (0.0, (240, 237, 229)),
    (0.2, (243, 217, 164)),
    (0.4, (226, 166, 92)),
    (0.7, (176, 108, 48)),
    (1.0, (112, 62, 24)),
)
"""Colour of a clutter slot by its failure probability: one hue from light to dark, readable
without colour vision and different from the colours of the blocks."""
VESTS: tuple[Rgb, ...] = ((255, 116, 32), (196, 214, 48), (72, 164, 232), (232, 104, 168))
"""Colours of workers' vests and of pedestrians, by person id."""
SKIN: Rgb = (214, 164, 134)
JACKET: Rgb = (58, 70, 92)
TROUSERS: Rgb = (44, 53, 70)
GLOVE: Rgb = (247, 189, 74)


def blend(scale: ColourScale, x: float) -> Rgb:
    """Return the colour of ``x``, that of the nearest end beyond the scale."""
    places = [at for at, _ in scale]
    channels = [np.interp(x, places, [colour[k] for _, colour in scale]) for k in range(3)]
    return round(float(channels[0])), round(float(channels[1])), round(float(channels[2]))
