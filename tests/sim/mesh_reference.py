"""All contacts and the distance of one state, by FCL on the UR10's collision meshes.

``raw`` meshes (triangles) are surfaces: only ``hull``, the convex hull of each link, finds a
body wholly inside a link, and measures distances: tens of milliseconds on raw meshes.
"""

from collections.abc import Iterator
from typing import Any, Literal

import fcl
import numpy as np
import trimesh

from app.sim.cells.cell import Cell
from app.sim.collision.fcl_reference import (
    BODY_NAMES,
    CollisionReference,
    Kind,
    MeshContact,
    collision_mesh,
)
from app.sim.core.arrays import Vec
from app.sim.robot.capsules import TOOL
from app.sim.robot.ur10 import LINK_NAMES

SELF_BODY_PAIRS = (
    ("base_link", ("forearm_link", "wrist_1_link", "wrist_2_link", "wrist_3_link", TOOL)),
    ("shoulder_link", ("forearm_link", "wrist_1_link", "wrist_2_link", "wrist_3_link", TOOL)),
    ("upper_arm_link", ("wrist_1_link", "wrist_2_link", "wrist_3_link", TOOL)),
    ("forearm_link", ("wrist_2_link", "wrist_3_link", TOOL)),
)
"""Bodies that may not touch. Left out: neighbours, which always overlap at their joint; base
and upper arm, which cannot meet; the wrists and the tool among themselves, three joints on one
column."""


def hull_of(mesh: trimesh.Trimesh) -> Any:
    """Return the mesh's convex hull as fcl's convex body."""
    hull = mesh.convex_hull
    faces = np.column_stack([np.full(len(hull.faces), 3), hull.faces]).ravel()
    return fcl.Convex(np.asarray(hull.vertices), len(hull.faces), faces)


class MeshReference(CollisionReference):
    """The reference checker for one state of robot and person."""

    def __init__(self, cell: Cell, mesh: Literal["raw", "hull"] = "raw") -> None:
        super().__init__(cell)
        if mesh == "hull":
            for name in LINK_NAMES:
                self._bodies[name] = fcl.CollisionObject(hull_of(collision_mesh(name)))

    def contacts(self, q: Vec, human_q: Vec | None = None) -> list[MeshContact]:
        """Return everything the robot touches, itself included; None: without a person."""
        self.place_robot(q)
        if human_q is not None:
            self.place_person(human_q)
        return [
            MeshContact(kind=kind, link=link, body=body)
            for link, body, kind in self._pairs(human_q is not None)
            if self.touching(link, body)
        ]

    def _pairs(self, with_person: bool) -> Iterator[tuple[str, str, Kind]]:
        for link, partners in SELF_BODY_PAIRS:
            yield from ((link, body, "self") for body in partners)
        for link in BODY_NAMES[1:]:  # the base stands on the table
            yield from ((link, body, "cell") for body in self._obstacles)
        if with_person:
            yield from ((link, body, "human") for link in BODY_NAMES for body in self._person)

    def distance(self, q: Vec, human_q: Vec) -> float:
        """Return the least distance between robot and person [m], 0 in contact."""
        self.place_robot(q)
        self.place_person(human_q)
        pairs = ((a, b) for a in self._bodies.values() for b in self._person.values())
        return max(min(fcl.distance(a, b) for a, b in pairs), 0.0)
