"""BVH files of a person of known stature and posture, in any unit, axis, naming and floor."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from app.sim.core.arrays import Vec
from app.sim.mocap.joint_centres import TRACK_NAMES

WORLD = {
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "z": np.eye(3),
    "-y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
}
"""From z up to the axis of the file that points up."""

_CENTRE = (
    ("Hips", "", (0.0, 0.0, 0.0)),
    ("Spine", "Hips", (0.0, 0.0, 0.05)),
    ("Chest", "Spine", (0.0, 0.0, 0.11)),
    ("Neck", "Chest", (0.0, 0.0, 0.10)),
    ("Head", "Neck", (0.01, 0.0, 0.05)),
    ("HeadEnd", "Head", (0.0, 0.0, 0.13)),
)
_SIDE = (
    ("{}Shoulder", "Chest", (0.0, 0.03, 0.10)),
    ("{}Arm", "{}Shoulder", (0.0, 0.075, 0.0)),
    ("{}ForeArm", "{}Arm", (0.0, 0.172, 0.0)),
    ("{}Hand", "{}ForeArm", (0.0, 0.149, 0.0)),
    ("{}UpLeg", "Hips", (0.0, 0.05, -0.03)),
    ("{}Leg", "{}UpLeg", (0.0, 0.0, -0.245)),
    ("{}Foot", "{}Leg", (0.0, 0.0, -0.246)),
    ("{}ToeBase", "{}Foot", (0.08, 0.0, -0.02)),
)
_CENTRES = dict(
    zip(
        TRACK_NAMES,
        "Hips Neck RightArm RightForeArm RightHand LeftArm LeftForeArm LeftHand".split(),
        strict=True,
    )
)


@dataclass(frozen=True, kw_only=True)
class Person:
    """What a recording shows, and how it is written."""

    stature: float = 1.72
    bend: float = 0.0
    """Of the spine, forward [deg]."""
    tilt: float = 0.0
    """Of the pelvis, forward; the legs stay upright [deg]."""
    thigh: float = 0.0
    """Raised forward from the vertical: 85 sits [deg]."""
    knee: float = 0.0
    """Bend of both knees: 85 sits, with the thighs upright it kneels [deg]."""
    heading: float = 0.4
    floor: float = 0.0
    """Height of the floor over the file's zero [m]."""
    unit: float = 0.01
    root_unit: float | None = None
    up: str = "y"
    rest_up: str = ""
    """Of the rest pose, where it is another."""
    legs: bool = True
    head: bool = True
    twisted: bool = False
    """Whether each joint has axes of its own, so that the rest pose tells nothing."""
    placed: bool = False
    """Whether all joints have positions for channels, and no offsets."""
    named: Callable[[str], str] = str
    n: int = 60
    dt: float = 0.02

    def without(self, role: str) -> bool:
        """Whether a joint is left out."""
        leg = any(part in role for part in ("Leg", "Foot", "Toe"))
        return (leg and not self.legs) or (role in ("Head", "HeadEnd") and not self.head)


def skeleton(who: Person) -> tuple[str, Vec]:
    """The file of a person who sways over standing feet and works, and the joint centres.

    Returns:
        The text, and the points in order of TRACK_NAMES, z up [m], shape (n, 8, 3).
    """
    joints = [
        *_CENTRE,
        *(
            (role.format(side), parent.format(side), (x, sign * y, z))
            for side, sign in (("Left", 1.0), ("Right", -1.0))
            for role, parent, (x, y, z) in _SIDE
        ),
    ]
    joints = [one for one in joints if not who.without(one[0])]
    turns, root = _motion(who)
    children: dict[str, list[tuple[str, tuple[float, float, float]]]] = {}
    for role, parent, offset in joints:
        children.setdefault(parent, []).append((role, offset))
    world, rest = WORLD[who.up], WORLD[who.rest_up or who.up]
    lines, columns = ["HIERARCHY"], [root @ world.T / (who.root_unit or who.unit)]
    points: dict[str, tuple[Vec, Vec]] = {}
    axes: dict[str, Vec] = {"": world}

    def write(role: str, offset: tuple[float, float, float], parent: str, depth: int) -> None:
        pad, place = "  " * depth, who.stature * np.array(offset)
        turn = turns.get(role, np.tile(np.eye(3), (who.n, 1, 1)))
        if parent:
            at, above = points[parent]
            points[role] = at + above @ place, above @ turn
        else:
            points[role] = root, turn
        axes[role] = rest
        if who.twisted:
            axes[role] = Rotation.random(random_state=len(axes)).as_matrix() @ rest
        local = (axes[parent] if parent else rest) @ place / who.unit
        x, y, z = ("0", "0", "0") if who.placed else (f"{one:.7g}" for one in local)
        if role == "HeadEnd":
            lines.extend([f"{pad}End Site", f"{pad}{{", f"{pad}  OFFSET {x} {y} {z}"])
            lines.append(f"{pad}}}")
            return
        rotations = "Zrotation Xrotation Yrotation"
        channels = f"3 {rotations}"
        if who.placed or not parent:
            channels = f"6 Xposition Yposition Zposition {rotations}"
        lines.append(f"{pad}{'JOINT' if parent else 'ROOT'} {who.named(role)}")
        lines.extend([f"{pad}{{", f"{pad}  OFFSET {x} {y} {z}", f"{pad}  CHANNELS {channels}"])
        if who.placed and parent:
            columns.append(np.tile(local, (who.n, 1)))
        in_file = Rotation.from_matrix(axes[parent] @ turn @ axes[role].T)
        with warnings.catch_warnings(action="ignore"):  # where two axes are in line
            columns.append(in_file.as_euler("ZXY", degrees=True))
        for child, offset in children.get(role, []):
            write(child, offset, role, depth + 1)
        lines.append(f"{pad}}}")

    write("Hips", (0.0, 0.0, 0.0), "", 0)
    rows = (" ".join(f"{value:.8g}" for value in row) for row in np.hstack(columns))
    head = ["MOTION", f"Frames: {who.n}", f"Frame Time: {who.dt}"]
    track = np.stack([points[_CENTRES[name]][0] for name in TRACK_NAMES], axis=1)
    return "\n".join([*lines, *head, *rows]) + "\n", track


def _motion(who: Person) -> tuple[dict[str, Vec], Vec]:
    """Rotations of the joints in their parents, z up, and the path of the hips [m]."""
    t = who.dt * np.arange(who.n)
    wave = np.sin(2.0 * t)

    def about(axis: str, degrees: Vec | float) -> Vec:
        angles = np.broadcast_to(np.asarray(degrees, dtype=float), t.shape)
        turn: Vec = Rotation.from_euler(axis, angles[:, None], degrees=True).as_matrix()
        return turn

    sway = 10.0 * wave
    heading = about("z", np.degrees(who.heading))
    turns = {"Hips": heading @ about("y", who.tilt), "Spine": about("y", who.bend + 4.0 * wave)}
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        raised = about("y", -20.0 + 15.0 * wave - who.bend) @ about("x", -sign * 80.0)
        turns[f"{side}Arm"] = raised
        turns[f"{side}ForeArm"] = about("z", -sign * (50.0 + 20.0 * wave))
        turns[f"{side}UpLeg"] = about("y", sway - who.thigh - who.tilt)
        turns[f"{side}Leg"] = about("y", who.knee)
        turns[f"{side}Foot"] = about("y", min(who.thigh, 90.0) - who.knee)
    upper, lower = np.array([0.0, 0.0, -0.245]), np.array([0.0, 0.0, -0.246])
    hips = turns["Hips"] @ np.array([0.0, 0.0, -0.03])
    thighs = heading @ about("y", sway - who.thigh)
    legs = thighs @ upper + thighs @ about("y", who.knee) @ lower
    feet = np.array([0.2, 0.5, who.floor + 0.039 * who.stature])
    return turns, feet - who.stature * (hips + legs)
