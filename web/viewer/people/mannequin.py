"""Surfaces, colours and skin weights of the drawn person, in eleven parts.

The surfaces come from ``data/mannequin.npz``, written by :mod:`tools.model_mannequin`; colours
and skin weights are defined here; :func:`fitted` adapts the surfaces to other body sizes.
Positions are stored as 16-bit shares of each part's box (steps below 0.03 mm).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from importlib import resources
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.sim.cells.colours import GLOVE, JACKET, SKIN, TROUSERS, VESTS, Rgb
from app.sim.core.arrays import Vec
from web.viewer.people import skeleton

Faces = NDArray[np.uint32]

_FILE = "data/mannequin.npz"
_STEPS = 65535


@dataclass(frozen=True, slots=True, kw_only=True)
class Surface:
    """A triangle mesh."""

    vertices: Vec
    """Vertex positions [m], shape (n, 3)."""
    faces: Faces
    """Vertex indices, shape (m, 3), outward winding."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """One piece of the mannequin."""

    name: str
    """Name of the node in the scene."""
    surface: Surface
    """Surface: in the bind pose for soft parts, in the frame of the bone for rigid ones."""
    color: Rgb
    """Colour, 0 to 255."""
    bone: str | None = None
    """Bone that a rigid part is attached to; None for soft parts."""
    weights: dict[str, Vec] = field(default_factory=dict)
    """Skin weights by bone for soft parts, each of shape (n_vertices,)."""


_COLORS: Mapping[str, Rgb] = {
    "jacket": JACKET,
    "vest": VESTS[0],
    "stripes": (238, 240, 228),
    "trousers": TROUSERS,
    "head": SKIN,
    "helmet": (250, 250, 246),
    "glasses": (36, 44, 54),
    "hand_l": GLOVE,
    "hand_r": GLOVE,
    "shoe_l": (33, 34, 38),
    "shoe_r": (33, 34, 38),
}
_BONES = {
    "head": "head",
    "helmet": "head",
    "glasses": "head",
    "hand_l": "hand_l",
    "hand_r": "hand_r",
    "shoe_l": "foot_l",
    "shoe_r": "foot_r",
}
_WEIGHTS: Mapping[str, Callable[[Vec], dict[str, Vec]]] = {
    "jacket": skeleton.upper_weights,
    "vest": skeleton.spine_weights,
    "stripes": skeleton.spine_weights,
    "trousers": skeleton.segment_weights,
}


def save(surfaces: Mapping[str, Surface], path: Path | None = None) -> None:
    """Write surfaces to the file that :func:`parts` reads, or to ``path``."""
    arrays: dict[str, NDArray[np.generic]] = {}
    for name, surface in surfaces.items():
        low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
        shares = np.round((surface.vertices - low) / (high - low) * _STEPS)
        arrays[f"{name}.box"] = np.stack([low, high])
        arrays[f"{name}.vertices"] = shares.astype(np.uint16)
        arrays[f"{name}.faces"] = surface.faces.astype(np.uint16)
    np.savez_compressed(path or Path(__file__).parent / _FILE, allow_pickle=False, **arrays)


def load(name: str, stored: Mapping[str, NDArray[np.generic]]) -> Surface:
    """Return one surface from the arrays that :func:`save` wrote."""
    low, high = np.asarray(stored[f"{name}.box"], dtype=np.float64)
    shares = np.asarray(stored[f"{name}.vertices"], dtype=np.float64) / _STEPS
    faces = np.asarray(stored[f"{name}.faces"], dtype=np.uint32)
    return Surface(vertices=low + shares * (high - low), faces=faces)


@lru_cache(maxsize=1)
def parts() -> tuple[Part, ...]:
    """Return all parts of the mannequin."""
    with (resources.files("web.viewer.people") / _FILE).open("rb") as file:
        with np.load(file, allow_pickle=False) as stored:
            surfaces = {name: load(name, stored) for name in _COLORS}
    return tuple(
        Part(
            name=name,
            surface=surface,
            color=_COLORS[name],
            bone=_BONES.get(name),
            weights=_WEIGHTS[name](surface.vertices) if name in _WEIGHTS else {},
        )
        for name, surface in surfaces.items()
    )


def color_of(part: Part, person: int) -> Rgb:
    """Return the colour of a part, 0 to 255, for the person with an id."""
    return VESTS[person % len(VESTS)] if part.name == "vest" else part.color


def fitted(part: Part, size: Vec) -> Vec:
    """Return a soft part's vertices [m], shape (n, 3), for a size [m], shape (12,).

    Each vertex is moved and scaled with its bones by its skin weights, so that the surface is
    connected between two bones.
    """
    median, own = skeleton.bind_bones(), skeleton.bind_bones(size)
    right, left = skeleton.scales(size, "r"), skeleton.scales(size, "l")
    out = np.zeros_like(part.surface.vertices)
    for name, weights in part.weights.items():
        before, after = median[name], own[name]
        local = (part.surface.vertices - before[:3, 3]) @ before[:3, :3]
        scale = np.where(local[:, 1:2] < 0.0, right[name], left[name])
        moved = (local * scale) @ after[:3, :3].T + after[:3, 3]
        out += weights[:, None] * moved
    return out
