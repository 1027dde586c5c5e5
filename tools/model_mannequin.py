"""Model the drawn person: a worker made of round cones, in a helmet and a vest.

``python -m tools.model_mannequin`` writes ``web/viewer/people/data/mannequin.npz``, which
:mod:`web.viewer.people.mannequin` loads. Soft parts (jacket, vest, stripes, trousers) are in
the bind pose of :mod:`web.viewer.people.skeleton`, rigid ones in the frame of their bone.
Requires the development extras (scipy, scikit-image).
"""

import numpy as np

from app.sim.core.arrays import Vec
from tools.arguments import parser_of
from tools.distance_fields import Cone, Grid, mirrored, smooth_min
from web.viewer.people import skeleton
from web.viewer.people.mannequin import Surface, save

Point = tuple[float, float, float]


def _point(values: Vec) -> Point:
    return float(values[0]), float(values[1]), float(values[2])


def _trunk() -> list[Cone]:
    return [
        Cone((0.0, 0.0, -0.03), (0.0, 0.0, 0.0), 0.155, 0.155, (0.72, 1.0, 0.8)),
        Cone((0.0, 0.0, 0.04), (0.0, 0.0, 0.2), 0.142, 0.15, (0.74, 1.0, 1.0), 0.08),
        Cone((0.01, 0.0, 0.27), (0.0, 0.0, 0.33), 0.165, 0.165, (0.76, 1.0, 0.9), 0.08),
        Cone((0.045, -0.07, 0.33), (0.045, 0.07, 0.33), 0.072, 0.072, blend=0.06),
        Cone((-0.055, -0.07, 0.36), (-0.055, 0.07, 0.36), 0.065, 0.065, blend=0.06),
        Cone((-0.01, -0.14, 0.405), (-0.01, 0.14, 0.405), 0.06, 0.06, blend=0.06),
        Cone((-0.02, 0.0, 0.455), (0.0, -0.15, 0.42), 0.055, 0.05, blend=0.05),
        Cone((-0.02, 0.0, 0.455), (0.0, 0.15, 0.42), 0.055, 0.05, blend=0.05),
    ]


def _sleeves() -> list[Cone]:
    cones = []
    bind = skeleton.bind_bones()
    for side in skeleton.SIDES:
        shoulder = bind[f"upper_{side}"][:3, 3]
        elbow, wrist = bind[f"fore_{side}"][:3, 3], bind[f"hand_{side}"][:3, 3]
        biceps = shoulder + 0.4 * (elbow - shoulder)
        calf = elbow + 0.25 * (wrist - elbow)
        cones += [
            Cone(_point(shoulder), _point(biceps), 0.064, 0.053, blend=0.07),
            Cone(_point(biceps), _point(elbow), 0.053, 0.044, blend=0.03),
            Cone(_point(elbow), _point(calf), 0.044, 0.047, blend=0.03),
            Cone(_point(calf), _point(wrist), 0.046, 0.033, blend=0.03),
        ]
    return cones


def _jacket() -> Surface:
    grid = Grid((-0.2, -0.74, -0.16), (0.2, 0.74, 0.55), 0.018)
    collar = Cone((-0.012, 0.0, 0.45), (-0.002, 0.0, 0.485), 0.068, 0.06, blend=0.03)
    return grid.mesh(grid.union([*_trunk(), *_sleeves(), collar]))


def _vest() -> tuple[Surface, Surface]:
    """Return vest and reflecting stripes: the trunk, inflated and cut to shape."""
    grid = Grid((-0.22, -0.26, -0.1), (0.22, 0.26, 0.52), 0.0138)
    trunk = grid.union(_trunk())
    x, y, z = np.moveaxis(grid.sample(lambda points: points), -1, 0)
    sleeve_hole = 0.155 - 0.35 * np.maximum(0.30 - z, 0.0) * -1.0
    cut = np.maximum(np.abs(y) - sleeve_hole, -0.05 - z)
    neck = 0.075 + 0.35 * np.maximum(x, 0.0) - np.hypot(y, 0.9 * (z - 0.5))
    front = np.where(x > 0.0, 0.55 * (z - 0.28) - np.abs(y) + 0.004, -1.0)
    cut = np.maximum(cut, np.maximum(neck, front))
    vest = np.maximum(trunk - 0.011, cut)
    bands = np.minimum(np.abs(z - 0.055), np.abs(z - 0.165)) - 0.021
    straps = np.maximum(np.abs(np.abs(y) - 0.1) - 0.02, 0.165 - z)
    stripes = np.maximum(trunk - 0.0145, np.maximum(np.minimum(bands, straps), cut + 0.004))
    return grid.mesh(vest, 0.8, hidden=trunk), grid.mesh(stripes, 0.7, hidden=trunk)


def _trousers() -> Surface:
    grid = Grid((-0.18, -0.24, -0.93), (0.18, 0.24, 0.08), 0.0195)
    cones = [Cone((0.0, 0.0, -0.05), (0.0, 0.0, 0.01), 0.15, 0.146, (0.72, 1.0, 0.85))]
    for sign in (-1.0, 1.0):
        hip, knee = (-0.005, sign * 0.085, -0.1), (0.012, sign * 0.095, -0.47)
        seat, calf = (-0.05, sign * 0.065, -0.07), (-0.012, sign * 0.1, -0.62)
        hem = (-0.015, sign * 0.105, -0.85)
        cones += [
            Cone(seat, (-0.045, sign * 0.07, -0.1), 0.075, 0.07, blend=0.05),
            Cone(hip, knee, 0.092, 0.064, blend=0.025),
            Cone(knee, calf, 0.064, 0.066, blend=0.03),
            Cone(calf, hem, 0.066, 0.062, blend=0.03),
        ]
    return grid.mesh(grid.union(cones))


def _shoe() -> Surface:
    """Return the left shoe in the foot's frame, the ankle at the origin."""
    grid = Grid((-0.12, -0.08, -0.1), (0.24, 0.08, 0.06), 0.011)
    upper = grid.union(
        [
            Cone((-0.03, 0.0, -0.045), (-0.01, 0.0, 0.02), 0.046, 0.047, blend=0.03),
            Cone((-0.04, 0.0, -0.055), (0.13, 0.005, -0.062), 0.045, 0.043, blend=0.04),
            Cone((0.0, 0.0, 0.0), (0.11, 0.005, -0.05), 0.042, 0.036, blend=0.04),
        ]
    )
    z = grid.sample(lambda points: points[..., 2])
    return grid.mesh(np.maximum(upper, -0.088 - z), 0.5)


def _hand() -> Surface:
    """Return the left glove in the hand's frame: wrist at the origin, fingers along -z.

    The palm is turned half-way between facing the body and facing back.
    """
    cones = [
        Cone((0.0, 0.0, 0.04), (0.0, 0.0, -0.01), 0.048, 0.036, blend=0.02),
        Cone((0.0, 0.0, -0.03), (0.0, 0.0, -0.085), 0.034, 0.043, (1.0, 0.5, 1.0), 0.03),
        Cone((0.03, -0.004, -0.03), (0.052, -0.014, -0.075), 0.016, 0.0125, blend=0.025),
        Cone((0.052, -0.014, -0.075), (0.05, -0.026, -0.105), 0.0125, 0.0105, blend=0.01),
    ]
    for index, length in enumerate((0.072, 0.083, 0.077, 0.06)):
        x = 0.031 - 0.0205 * index
        spread = 1.0 + 0.12 * (1.5 - index) * 0.1
        middle = (x * spread, -0.006, -0.1 - 0.5 * length)
        tip = (x * spread * 0.97, -0.03, -0.1 - 0.9 * length)
        cones += [
            Cone((x, 0.0, -0.095), middle, 0.0115, 0.0108, blend=0.008),
            Cone(middle, tip, 0.0108, 0.0092, blend=0.008),
        ]
    grid = Grid((-0.07, -0.07, -0.2), (0.085, 0.06, 0.06), 0.007)
    glove = grid.mesh(grid.union(cones), 0.5)
    c, s = np.cos(0.8), np.sin(0.8)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return Surface(vertices=glove.vertices @ turn.T, faces=glove.faces)


def _head() -> tuple[Surface, Surface]:
    """Return head and helmet in the head's frame, the base of the neck at the origin."""
    skull = [
        Cone((-0.015, 0.0, -0.03), (-0.002, 0.0, 0.1), 0.056, 0.05, blend=0.03),
        Cone((0.005, 0.0, 0.2), (0.0, 0.0, 0.215), 0.105, 0.105, (0.98, 0.78, 1.0), 0.03),
        Cone((0.035, 0.0, 0.135), (0.055, 0.0, 0.105), 0.06, 0.042, (1.0, 0.9, 1.0), 0.05),
        Cone((0.098, 0.0, 0.185), (0.116, 0.0, 0.158), 0.009, 0.0135, blend=0.022),
        Cone((0.07, -0.035, 0.205), (0.07, 0.035, 0.205), 0.036, 0.036, blend=0.03),
        Cone((0.09, -0.014, 0.125), (0.09, 0.014, 0.125), 0.012, 0.012, blend=0.02),
    ]
    for sign in (-1.0, 1.0):
        ear = (-0.008, sign * 0.083, 0.185), (-0.002, sign * 0.081, 0.155)
        skull.append(Cone(ear[0], ear[1], 0.021, 0.014, (1.0, 0.45, 1.0), 0.012))
    grid = Grid((-0.15, -0.13, -0.06), (0.17, 0.13, 0.34), 0.011)
    head = grid.mesh(grid.union(skull), 0.8)
    return head, _helmet()


def _glasses() -> Surface:
    """Return safety glasses in the head's frame: a visor, bent around the face."""
    grid = Grid((-0.06, -0.11, 0.13), (0.15, 0.11, 0.25), 0.0055)
    x, y, z = np.moveaxis(grid.sample(lambda points: points), -1, 0)
    shell = np.abs(np.hypot(x / 0.122, y / 0.09) - 1.0) * 0.1 - 0.006
    nose = 0.016 - np.hypot(y, z - 0.166)
    front = np.maximum(np.abs(z - 0.19) - 0.02, np.maximum(0.05 - x, nose))
    temple = np.maximum(np.abs(z - 0.196) - 0.006, np.maximum(x - 0.06, -0.02 - x))
    return grid.mesh(np.maximum(shell, np.minimum(front, temple)), 0.5)


def _helmet() -> Surface:
    grid = Grid((-0.17, -0.15, 0.16), (0.23, 0.15, 0.39), 0.011)
    dome = grid.union(
        [
            Cone((0.005, 0.0, 0.225), (0.0, 0.0, 0.245), 0.128, 0.125, (1.0, 0.84, 0.92)),
            Cone((-0.06, 0.0, 0.345), (0.06, 0.0, 0.345), 0.018, 0.018, blend=0.03),
        ]
    )
    x, y, z = np.moveaxis(grid.sample(lambda points: points), -1, 0)
    dome = np.maximum(dome, 0.222 - 0.1 * x - z)
    brim_height = np.abs(z - (0.226 + 0.1 * x - 1.2 * np.maximum(x - 0.1, 0.0) ** 2))
    brim = np.maximum(np.hypot((x - 0.028) / 1.18, y / 0.9) - 0.134, brim_height - 0.006)
    return grid.mesh(smooth_min(dome, brim, 0.015), 0.6)


def model() -> dict[str, Surface]:
    """Return the parts' surfaces by name."""
    vest, stripes = _vest()
    shoe, hand = _shoe(), _hand()
    head, helmet = _head()
    return {
        "jacket": _jacket(),
        "vest": vest,
        "stripes": stripes,
        "trousers": _trousers(),
        "head": head,
        "helmet": helmet,
        "glasses": _glasses(),
        "hand_l": hand,
        "hand_r": mirrored(hand),
        "shoe_l": shoe,
        "shoe_r": mirrored(shoe),
    }


if __name__ == "__main__":
    parser_of(__doc__).parse_args()
    save(model())
