"""Geometry of a case study: nearer goal, and times at which the person blocks a goal.

No policy takes part. The robot is considered at rest at its start, and in the configurations
over each goal and at its object; the person moves as in the case.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations

import numpy as np

from app.sim.cells.cell import Cell
from app.sim.collision.checker import Checker, shapes_of
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.pick.batch import target_configurations
from app.sim.pick.cases import Case, palms_of, script_of
from app.sim.pick.kernels.grasp import GraspRules
from app.sim.robot.kernels import arm as arm_kernel
from app.sim.robot.kernels.arm import Arm
from app.sim.scene.scene import arm_of

PERIOD = 0.05
"""Time between two checked postures of the person [s]."""
BLOCKED_BELOW = 0.0
"""Clearance below which a goal is blocked [m]."""
PATH_STEP = 0.02
"""Largest joint difference between two points of a path whose length is measured [rad]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StationGeometry:
    """The robot at the stations of a cell, by station."""

    position: Mapping[str, Vec]
    """Position of the target [m], shape (3,)."""
    over: Mapping[str, Vec]
    """Joint positions over the object; starts, too [rad], shape (6,)."""
    at_object: Mapping[str, Vec]
    """Joint positions at the object [rad], shape (6,)."""
    tool_path_m: Mapping[tuple[str, str], float]
    """Length of the tool's path from one station to another in straight joint motion [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PersonGeometry:
    """The person of a case study beside the robot at each station."""

    times: Vec
    """Checked times, to the end of the person's motion [s], shape (t,)."""
    palms: Vec
    """Palm of the working hand in the first and in the last posture [m], shape (2, 3)."""
    palm_error_m: float
    """Largest distance of these palms from where the case puts them [m]."""
    start_m: Mapping[str, Vec]
    """Clearance of the robot that rests over a station [m], shape (t,)."""
    goal_m: Mapping[str, Vec]
    """Clearance of the robot over a station and at its object, the lesser [m], shape (t,)."""
    ends: tuple[Checker, Checker]
    """Collision checks beside the first and the last posture."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseGeometry:
    """Start and goals of a case study beside its person."""

    stations: StationGeometry
    """The robot at the stations."""
    person: PersonGeometry
    """The person."""
    start: str
    """Station from which the robot starts."""
    nearer: str
    """Goal with the shorter path of the tool."""
    farther: str
    """The other goal."""

    def tool_path_m(self, goal: str) -> float:
        """Return the length of the tool's path to a goal in straight joint motion [m]."""
        return self.stations.tool_path_m[self.start, goal]

    def blocked_s(self, goal: str) -> tuple[float, float] | None:
        """Return the first and the last time at which a goal is blocked [s]; None for never."""
        when = self.person.times[self.person.goal_m[goal] < BLOCKED_BELOW]
        return (float(when[0]), float(when[-1])) if when.size else None

    def arrival_s(self, goal: str) -> float:
        """Return the duration of the straight joint motion to a goal at maximum speed [s]."""
        over, limits = self.stations.over, self.person.ends[0].arm.limits
        return float((np.abs(over[goal] - over[self.start]) / limits.qd_max).max())

    def earliest_pick_s(self, goal: str) -> float:
        """Return a time before which no pick of a goal can end [s]: the gripper closes, too."""
        return self.arrival_s(goal) + GraspRules().close_s

    def path_free(self, goal: str, end: int, margin: float, *, around: bool = False) -> bool:
        """Return whether the robot can move from its start to a goal beside one posture.

        Args:
            goal: The goal.
            end: 0 for the person's first posture, -1 for the last one.
            margin: Distance to keep from the person [m].
            around: Whether a path of two straight joint motions by way of home is sufficient.
        """
        known, over = self.person.ends[end], self.stations.over
        checker = Checker(known.arm, known.people, margin)
        first, last = over[self.start], over[goal]
        if checker.edge_free(first, last):
            return True
        return around and checker.path_free(np.stack([first, known.arm.home, last]))


@lru_cache(maxsize=2)
def stations_of(cell: Cell) -> StationGeometry:
    """Measure the robot at the stations of a cell."""
    arm, ids = arm_of(cell), [station.id for station in cell.pick_stations]
    position = np.array([station.position for station in cell.pick_stations])
    over, at_object, _ = target_configurations(arm, GraspRules(), position)
    of_id = dict(zip(ids, over, strict=True))
    return StationGeometry(
        position=dict(zip(ids, position, strict=True)),
        over=of_id,
        at_object=dict(zip(ids, at_object, strict=True)),
        tool_path_m={
            (a, b): _tool_path(arm, of_id[a], of_id[b]) for a, b in permutations(ids, 2)
        },
    )


def _tool_path(arm: Arm, first: Vec, last: Vec) -> float:
    """Return the length of the tool's path in straight joint motion [m]."""
    pose = arm_kernel.new_robot_pose(arm)
    n = int(np.ceil(np.abs(last - first).max() / PATH_STEP))
    tcp = np.empty((n + 1, 3))
    for k, q in enumerate(np.linspace(first, last, n + 1)):
        arm_kernel.place_robot(arm, q, pose)
        tcp[k] = pose.tcp
    return float(np.linalg.norm(np.diff(tcp, axis=0), axis=1).sum())


def person_geometry(cell: Cell, case: Case) -> PersonGeometry:
    """Measure the person of a case study; its start and goals do not matter."""
    arm, stations, script = arm_of(cell), stations_of(cell), script_of(cell, case)
    times = np.arange(0.0, script.end_s + PERIOD, PERIOD)
    postures = [script.at(float(t))[0] for t in times]
    beside = [Checker(arm, shapes_of(cell, q[None])) for q in postures]
    palms = np.array(
        [
            human.joint_points(q, cell.body)[f"hand_{case.hand}"]
            for q in (postures[0], postures[-1])
        ]
    )
    start = {name: _clearances(beside, q) for name, q in stations.over.items()}
    return PersonGeometry(
        times=times,
        palms=palms,
        palm_error_m=float(np.linalg.norm(palms - palms_of(cell, case), axis=1).max()),
        start_m=start,
        goal_m={
            name: np.minimum(start[name], _clearances(beside, q))
            for name, q in stations.at_object.items()
        },
        ends=(beside[0], beside[-1]),
    )


def _clearances(beside: list[Checker], q: Vec) -> Vec:
    """Return the clearance to the person at ``q`` [rad] in each posture [m]."""
    return np.array([checker.clearance(q).people_m for checker in beside])


def case_geometry(cell: Cell, case: Case, person: PersonGeometry | None = None) -> CaseGeometry:
    """Measure a case study; ``person`` is its person, where already measured."""
    stations, start = stations_of(cell), case.robot_start
    nearer, farther = sorted(case.goals, key=lambda goal: stations.tool_path_m[start, goal])
    return CaseGeometry(
        stations=stations,
        person=person or person_geometry(cell, case),
        start=start,
        nearer=nearer,
        farther=farther,
    )
