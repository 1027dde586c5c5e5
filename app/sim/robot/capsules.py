"""Capsules that contain the collision meshes of the robot and its tool, for the kernels.

The capsules *contain* the collision meshes of example-robot-data (fitted once by
``tools.fit_capsules``, committed as data), so that a kernel may report contact early, never
late. A capsule is the set of points within ``radius`` of the segment ``p0``-``p1``.
"""

import json
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.robot.ur10 import LINK_NAMES, Robot

Index = NDArray[np.int64]

CAPSULE_FILE = Path(str(resources.files("app.sim.robot"))) / "data" / "ur10_capsules.json"
"""The fitted capsules, in the frames of their links [m]."""

TOOL = "tool"
"""Name of the tool's capsule."""

TOOL_AXIS = np.array([0.0, 1.0, 0.0])
"""z axis of ``tool0`` in the frame of wrist_3_link, as for all robots of the UR family."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotCapsules:
    """The robot and its tool as n capsules, each rigidly tied to one link."""

    name: tuple[str, ...]
    """Name of each capsule."""
    link: Index
    """Place of its link in ``robot.LINK_NAMES``, shape (n,)."""
    p0: Vec
    """One end of its segment in the link's frame [m], shape (n, 3)."""
    p1: Vec
    """The other end [m], shape (n, 3)."""
    radius: Vec
    """Its radius [m], shape (n,)."""


def tool_capsule(tool_length: float, tool_radius: float) -> tuple[Vec, Vec]:
    """Return the ends of the tool's segment in the frame of wrist_3_link [m], shape (3,) each.

    The tool extends from the flange to the tcp, ``tool_length`` [m] along z of ``tool0``; its
    round end, of ``tool_radius`` [m], touches the tcp.
    """
    flange = Robot(tool_length).lengths().flange * TOOL_AXIS
    reach = max(tool_length - tool_radius, 0.0)
    return flange, flange + reach * TOOL_AXIS


@lru_cache(maxsize=8)
def load_robot_capsules(tool_length: float = 0.12, tool_radius: float = 0.04) -> RobotCapsules:
    """Return the fitted capsules and the tool's, last; the arrays are read-only."""
    rows = json.loads(CAPSULE_FILE.read_text())["capsules"]
    start, end = tool_capsule(tool_length, tool_radius)
    p0 = np.array([*(row["p0"] for row in rows), start])
    p1 = np.array([*(row["p1"] for row in rows), end])
    radius = np.array([*(row["radius"] for row in rows), tool_radius])
    links = [*(LINK_NAMES.index(row["link"]) for row in rows), len(LINK_NAMES) - 1]
    link = np.array(links, dtype=np.int64)
    for array in (p0, p1, radius, link):
        array.flags.writeable = False
    names = (*(str(row["name"]) for row in rows), TOOL)
    return RobotCapsules(name=names, link=link, p0=p0, p1=p1, radius=radius)


SELF_PAIRS = (
    ("base", ("forearm_mid", "forearm_high", "wrist_2", "wrist_3", TOOL)),
    ("shoulder", ("wrist_2", "wrist_3", TOOL)),
    ("upper_arm_low", ("wrist_2", "wrist_3", TOOL)),
    ("upper_arm_mid", ("wrist_2", "wrist_3", TOOL)),
    ("forearm_mid", ("wrist_2", "wrist_3", TOOL)),
)
"""Capsules that can touch although their links are not neighbours.

All other pairs of non-adjacent links have a clearance in every configuration with the elbow
within MOST_ELBOW and the tool within SMALL_TOOL (at least 4 mm, by search). Pairs that only a
wrist separates are excluded, wrist_1 or wrist_2 and the tool, and base and upper arm, whose
capsules overlap although the meshes do not.
"""
SMALL_TOOL = (0.12, 0.04)
"""Length and radius of a tool [m]; a longer or thicker one also reaches the capsules of
LARGE_TOOL_PAIRS."""
LARGE_TOOL_PAIRS = ("upper_arm_high", "forearm_low", "forearm_high")
"""Capsules that such a tool can touch."""
MOST_ELBOW = 2.8
"""Elbow angle beyond which other capsules touch [rad]."""


def self_pairs(capsules: RobotCapsules) -> Index:
    """Return the pairs of capsules to check for self-collision, shape (m, 2)."""
    place = {name: index for index, name in enumerate(capsules.name)}
    pairs = [(place[a], place[b]) for a, partners in SELF_PAIRS for b in partners]
    radius = float(capsules.radius[-1])
    length = float(np.linalg.norm(capsules.p1[-1] - capsules.p0[-1])) + radius
    if length > SMALL_TOOL[0] + 1e-9 or radius > SMALL_TOOL[1]:
        pairs += [(place[name], place[TOOL]) for name in LARGE_TOOL_PAIRS]
    return np.array(pairs, dtype=np.int64)


LEVERS = (1.4432, 1.4319, 0.8199, 0.2476, 0.2123, 0.0469)
"""Greatest distance of any point of the capsules from each joint's axis [m], with a tool of
0.12 m and radius 0.04 m; found by search over all configurations, rounded up."""


def levers(tool_length: float = 0.12, tool_radius: float = 0.04) -> Vec:
    """Return the largest distance of the robot from each joint's axis [m], shape (6,).

    A point moves at most at the sum of joint speeds times levers. A longer or thicker tool adds
    its excess; the last joint turns the tool about itself.

    Args:
        tool_length: Distance from flange to tcp [m].
        tool_radius: Radius of the tool [m].
    """
    longer, thicker = max(tool_length - 0.12, 0.0), max(tool_radius - 0.04, 0.0)
    return np.array(LEVERS) + longer * np.array([1.0, 1.0, 1.0, 1.0, 1.0, 0.0]) + thicker
