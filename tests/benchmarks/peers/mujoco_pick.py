"""The peer of ``bench_sim_steps``: distances and contacts of the pick cell in MuJoCo.

MuJoCo is given what it is good at. The robot is a chain of hinges with the kernels' capsules,
the person's capsules are ``mocap`` bodies whose poses are looked up and not computed, the table
is a plane. A step writes joints and poses of the next moment of a recorded episode, places all
bodies (``mj_kinematics``) and measures: nothing moves by forces, nothing is observed or
rewarded, and each moment is looked at once where the kernels sweep the whole period.

Three ways to measure:

``distances``  ``mj_geomDistance`` from Python, once per pair, as its users do
``sensors``    one distance sensor per pair, read by one call: no Python between the pairs
``contacts``   ``mj_collision``: its broad phase and narrow phase tell who touches, not how far
"""

import importlib.util
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.robot.capsules import RobotCapsules, load_robot_capsules, self_pairs
from app.sim.robot.kernels.arm import FIRST_OVER_TABLE
from app.sim.robot.ur10 import Robot

MODES = ("distances", "sensors", "contacts")
INSTALLED = importlib.util.find_spec("mujoco") is not None
CUTOFF = 1e3
"""Distances up to this are asked for: all [m]."""
QUARTER = "0.7071067811865476 0 0.7071067811865476 0"
"""A quarter turn about y, as a quaternion w, x, y, z."""
LENGTHS = Robot().lengths()
JOINTS = (
    # Place in the link before it [m], turn, axis; see ``robot/kernels/kinematics.py``.
    ((0.0, 0.0, LENGTHS.base_height), "1 0 0 0", "0 0 1"),
    ((0.0, LENGTHS.shoulder_offset, 0.0), QUARTER, "0 1 0"),
    ((0.0, LENGTHS.elbow_offset, LENGTHS.upper_arm), "1 0 0 0", "0 1 0"),
    ((0.0, 0.0, LENGTHS.forearm), QUARTER, "0 1 0"),
    ((0.0, LENGTHS.wrist_1_offset, 0.0), "1 0 0 0", "0 0 1"),
    ((0.0, 0.0, LENGTHS.wrist_2_length), "1 0 0 0", "0 1 0"),
)


class MujocoPick:
    """The pick cell in MuJoCo, posed along a recorded episode.

    Args:
        cell: Work cell.
        q: The robot's joints at each moment [rad], shape (n, 6).
        human_q: The person's joints at each moment [m, rad], shape (n, 18).
        mode: One of MODES.
    """

    def __init__(self, cell: Cell, q: Vec, human_q: Vec, mode: str) -> None:
        import mujoco  # noqa: PLC0415 - a peer that need not be there

        self._mujoco, self._mode = mujoco, mode
        capsules = load_robot_capsules(cell.robot.tool_length, cell.robot.tool_radius)
        self.pairs = _pairs(capsules)
        model = mujoco.MjModel.from_xml_string(_scene(cell, capsules, self.pairs, mode))
        self._model, self._data = model, mujoco.MjData(model)
        self._ids = [(model.geom(a).id, model.geom(b).id) for a, b in self.pairs]
        self._q, self._poses = q, [_mocap_poses(cell, row) for row in human_q]
        self._tick = 0

    def step(self) -> float | bool:
        """Go to the next moment; return the least distance [m] or whether anything touches."""
        self.place(self._tick)
        self._tick = (self._tick + 1) % len(self._q)
        if self._mode == "contacts":
            return self.touches()
        return float(min(self.distances()))

    def place(self, tick: int) -> None:
        """Place robot and person as they are at moment ``tick``."""
        data = self._data
        data.qpos[:] = self._q[tick]
        data.mocap_pos[:], data.mocap_quat[:] = self._poses[tick]
        self._mujoco.mj_kinematics(self._model, data)

    def distances(self) -> Sequence[float] | NDArray[np.float64]:
        """Return the distances of ``pairs`` [m]."""
        model, data = self._model, self._data
        if self._mode == "sensors":
            self._mujoco.mj_sensorPos(model, data)
            return np.asarray(data.sensordata)
        ask = self._mujoco.mj_geomDistance
        return [ask(model, data, a, b, CUTOFF, None) for a, b in self._ids]

    def touches(self) -> bool:
        """Tell whether MuJoCo finds a contact."""
        self._mujoco.mj_collision(self._model, self._data)
        return bool(self._data.ncon > 0)


def _pairs(capsules: RobotCapsules) -> list[tuple[str, str]]:
    """Return the names of all pairs measured: with the person, with itself, with the table."""
    names = capsules.name
    person = [(a, f"human_{b}") for a in names for b in human.CAPSULE_NAMES]
    own = [(names[a], names[b]) for a, b in self_pairs(capsules).tolist()]
    return person + own + [(a, "table") for a in names[FIRST_OVER_TABLE:]]


def _scene(cell: Cell, capsules: RobotCapsules, pairs: list[tuple[str, str]], mode: str) -> str:
    """Return the scene in MuJoCo's own format."""
    robot = _geoms(capsules, 0, mode)
    for joint, (place, turn, axis) in enumerate(JOINTS):
        robot += (
            f'<body pos="{_numbers(place)}" quat="{turn}"><joint type="hinge" axis="{axis}"/>'
            + _geoms(capsules, joint + 1, mode)
        )
    robot += "</body>" * len(JOINTS)
    ends = human.capsules(np.zeros(18), cell.body, cell.floor_z)
    half = 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    touchable = _touchable(0, 1, mode)
    person = "".join(
        f'<body mocap="true"><geom name="human_{name}" type="capsule" {touchable} '
        f'size="{_numbers((radius, length))}"/></body>'
        for name, radius, length in zip(
            human.CAPSULE_NAMES, human.CAPSULE_RADII, half, strict=True
        )
    )
    table = f'<geom name="table" type="plane" size="5 5 1" {_touchable(0, 2, mode)}/>'
    # What stands still is never tested against what is posed from outside, and neighbours are
    # not tested at all, unless a pair says so.
    asked = [(a, b) for a, b in pairs if a == capsules.name[0] or b in capsules.name]
    contact = "".join(f'<pair geom1="{a}" geom2="{b}"/>' for a, b in asked)
    sensor = "".join(f'<distance geom1="{a}" geom2="{b}" cutoff="{CUTOFF}"/>' for a, b in pairs)
    return (
        f"<mujoco><worldbody>{table}{robot}{person}</worldbody>"
        f"<contact>{contact if mode == 'contacts' else ''}</contact>"
        f"<sensor>{sensor if mode == 'sensors' else ''}</sensor></mujoco>"
    )


def _geoms(capsules: RobotCapsules, link: int, mode: str) -> str:
    """Return the capsules of one link."""
    return "".join(
        f'<geom name="{capsules.name[k]}" type="capsule" size="{float(capsules.radius[k])!r}" '
        f'fromto="{_numbers((*capsules.p0[k], *capsules.p1[k]))}" '
        f"{_touchable(3 if k >= FIRST_OVER_TABLE else 1, 0, mode)}/>"
        for k in np.flatnonzero(capsules.link == link)
    )


def _touchable(kind: int, others: int, mode: str) -> str:
    """Return with what MuJoCo's broad phase tests a shape; only contacts need it."""
    kind, others = (kind, others) if mode == "contacts" else (0, 0)
    return f'contype="{kind}" conaffinity="{others}"'


def _numbers(values: Sequence[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _mocap_poses(cell: Cell, q: Vec) -> tuple[Vec, Vec]:
    """Return middles [m], shape (12, 3), and quaternions w, x, y, z of a person's capsules."""
    ends = human.capsules(q, cell.body, cell.floor_z)
    span = ends[:, 1] - ends[:, 0]
    span *= np.where(span[:, 2:] < 0.0, -1.0, 1.0)
    length = np.linalg.norm(span, axis=1)
    turn = np.column_stack([length + span[:, 2], -span[:, 1], span[:, 0], 0.0 * length])
    return ends.mean(axis=1), turn / np.linalg.norm(turn, axis=1, keepdims=True)
