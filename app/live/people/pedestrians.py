"""People of a live reach cell: up to four pedestrians as vertical cylinders.

They walk continuously after docs/method.md 2.1 and avoid neither each other nor the robot. A
visitor can set a common speed, stop a person or drag one; dragged cylinders follow with
bounded speed, so that observed velocities are the true ones.

Deviates: p_still is 0 and p_go_on is 0.01 per period, as in the authors' code; in
docs/method.md 2.1 both are per episode.
"""

import math
from dataclasses import replace

import numpy as np

from app.live.arm import HumanGeometry
from app.live.command_checks import people_after
from app.live.commands import (
    AddPerson,
    Mode,
    MovePerson,
    RemovePerson,
    SetAnthropometry,
    SetMotion,
)
from app.live.people.anthropometry import anthropometry_snapshot
from app.live.people.people_by_id import PeopleById
from app.live.read_model import frozen
from app.live.snapshot import CylinderSnapshot, PersonSnapshot
from app.sim.cells.cell import Cell
from app.sim.collision.contact import pedestrian_distances
from app.sim.core.arrays import Vec
from app.sim.core.kernels.rng import start_stream
from app.sim.human.anthropometry import MEDIAN
from app.sim.human.kernels.kinematics import N_SIZE
from app.sim.human.model import rest_posture
from app.sim.human.person import Person
from app.sim.people.kernels.pedestrian import (
    AGE,
    COURSE_X,
    COURSE_Y,
    FIXED,
    FIXED_SPEED,
    GAIT,
    GROWTH,
    KIND,
    LEFT,
    MIDDLE,
    PAST_SPEED,
    RADIUS,
    SPEED,
    STILL,
    TARGET_X,
    TARGET_Y,
    VX,
    VY,
    WALKING,
    R,
    X,
    Y,
    advance_pedestrian,
    start_pedestrian,
)
from app.sim.people.kernels.people import MAX_PEOPLE
from app.sim.people.pedestrian import (
    AUTHORS_WALK,
    PedestrianSettings,
    pedestrian_rules,
    pedestrian_state,
)
from app.sim.perception.observed_people import person_from_cylinder
from app.sim.scene.scene import arm_of, pedestrian_settings, people_of

DRAG_SPEED = 1.2
"""Maximum speed of a dragged cylinder [m/s]."""
DRAG_LAG_S = 0.12
"""Time constant of a dragged cylinder [s]."""
TURN_RATE = 4.0
"""Turning rate of the mannequin [rad/s]; for drawing only."""
SLOW = 0.05
"""Speed below which the mannequin keeps its heading [m/s]."""
START_TRIES = 60
"""Number of start positions drawn for a new person."""
START_CLEARANCE_M = 0.8
"""Minimum distance from the robot at the start [m]."""
START_SPACING_M = 0.9
"""Minimum distance between the axes of two people at the start [m]."""
DRAG_MARGIN = 0.6
"""Margin of the walking area for dragging [m]."""
UPRIGHT = anthropometry_snapshot(MEDIAN, (50.0, 50.0, 50.0), recorded=False)
"""Body dimensions of the mannequin inside a cylinder."""


class LivePedestrians(PeopleById["LivePedestrian"]):
    """Pedestrians of one live reach cell; arrays are indexed by person id."""

    def __init__(self, cell: Cell, seed: int) -> None:
        self._seed = seed
        self.body = cell.body
        """Body lengths of the mannequin inside a cylinder [m], shape (12,)."""
        self._arm, self._shared = arm_of(cell), people_of(cell)
        self.robot_q = np.array(self._arm.home)
        """Configuration of the robot [rad], shape (6,); people start away from it."""
        self._walk = live_settings(cell)
        self._rules = pedestrian_rules([self._walk] * MAX_PEOPLE)
        self._own_kind = float(self._rules.rows[0, KIND])
        self.height = max([one.height for one in cell.cylinders], default=2.0)
        """Height of the cylinders [m]."""
        self.speed: float | None = None
        """Common walking speed [m/s]; None: variable (docs/method.md 2.1)."""
        self.dt = cell.robot.dt
        """Control period [s]."""
        self._state = pedestrian_state(1, MAX_PEOPLE)
        self._drawn = np.zeros((MAX_PEOPLE, RADIUS - SPEED))
        self._episode = 0
        self._people: dict[int, LivePedestrian] = {}
        for id in range(len(cell.people)):
            self._add(id)

    @property
    def rows(self) -> Vec:
        """States of the people as kernels use them, shape (n, N_STATE)."""
        return self._state.rows[0, list(self._people)]

    @property
    def cylinders(self) -> Vec:
        """x, y and radius of the people [m], shape (n, 3)."""
        return self.rows[:, [X, Y, R]]

    @property
    def geometry(self) -> HumanGeometry:
        """Collision geometry: cylinders only."""
        going = self.rows[:, [VX, VY, GROWTH]]
        no_joints = np.zeros((0, 18))
        return HumanGeometry(no_joints, no_joints, np.zeros((0, N_SIZE)), self.cylinders, going)

    def restart(self) -> None:
        """Draw new starts for walking people; others keep their positions."""
        for one in self:
            if one.mode == "auto":
                self._place(one.id)

    def change(self, command: AddPerson | RemovePerson) -> None:
        """Add or remove a person."""
        ids = people_after(command, self.ids)
        for id in ids:
            if id not in self._people:
                self._add(id)
        self._people = {id: self._people[id] for id in ids}

    def move(self, dt: float) -> None:
        """Move all people for ``dt`` [s]."""
        for one in self:
            advance_pedestrian(self._rules, self._state, 0, one.id, dt)
            one.after(dt)

    def move_while_paused(self, dt: float) -> bool:
        """Move dragged people for ``dt`` [s]; return whether one moved."""
        moved = [one.after(dt) for one in self if one.mode == "manual"]
        return any(moved)

    def set_speed(self, speed: float | None) -> None:
        """Set a common walking speed [m/s]; None: variable (docs/method.md 2.1)."""
        self.speed = speed
        for one in self:
            self._set_pace(one.id)

    def _add(self, id: int) -> None:
        self._people[id] = LivePedestrian(self, id, self._state.rows[0, id])
        self._place(id)

    def _place(self, id: int) -> None:
        """Draw position, course, speed and radius profile, away from robot and people."""
        others = [one.row for one in self if one.id != id]
        self._rules.rows[id, KIND] = self._own_kind
        for _ in range(START_TRIES):
            self._episode += 1
            stream = np.zeros(1, dtype=np.uint64)
            start_stream(self._seed, 0, self._episode, stream)
            start_pedestrian(self._rules, self._state, 0, id, stream)
            row = self._state.rows[0, id]
            spacing = [math.hypot(row[X] - o[X], row[Y] - o[Y]) for o in others]
            gap = pedestrian_distances(
                self._arm, self._shared, self.robot_q, row[None, [X, Y, R]]
            )
            apart = min(spacing, default=np.inf) > START_SPACING_M
            if apart and gap[0] >= START_CLEARANCE_M:
                break
        self._drawn[id] = self._state.rows[0, id, SPEED:RADIUS]
        self._set_pace(id)
        self._people[id].placed()

    def _set_pace(self, id: int) -> None:
        """Set the speed profile of a person: the common speed, or its own profile."""
        rule, speed = self._rules.rows[id], self._state.rows[0, id, SPEED:RADIUS]
        if self.speed is None:
            rule[KIND], speed[:] = self._own_kind, self._drawn[id]
        else:
            rule[KIND], rule[FIXED] = FIXED_SPEED, self.speed
            speed[:] = 0.0
            speed[MIDDLE] = self.speed

    def draw_target(self, rng: np.random.Generator) -> Vec:
        """Draw a point of the walking area [m], shape (2,)."""
        walk = self._walk
        return rng.uniform([walk.x_min, walk.y_min], [walk.x_max, walk.y_max])

    def walkable(self, x: float, y: float) -> tuple[float, float]:
        """Return the point nearest to (x, y) [m] inside the area for dragging."""
        walk = self._walk
        return (
            min(max(x, walk.x_min - DRAG_MARGIN), walk.x_max + DRAG_MARGIN),
            min(max(y, walk.y_min - DRAG_MARGIN), walk.y_max + DRAG_MARGIN),
        )

    def is_outside(self, x: float, y: float) -> bool:
        """Return whether (x, y) [m] is outside the walking area."""
        walk = self._walk
        return not (walk.x_min <= x <= walk.x_max and walk.y_min <= y <= walk.y_max)


class LivePedestrian:
    """One pedestrian; changes its row of the shared state, shape (N_STATE,), in place."""

    def __init__(self, among: LivePedestrians, id: int, row: Vec) -> None:
        self._among, self.id, self.row = among, id, row
        self.mode: Mode = "auto"
        """Motion source."""
        self.yaw = -0.5 * math.pi
        """Heading of the mannequin [rad]."""
        self._aim = np.zeros(2)
        self._rng = np.random.default_rng(id)

    def placed(self) -> None:
        """Set heading and drag target after a new start."""
        self.yaw = math.atan2(self.row[COURSE_Y], self.row[COURSE_X])
        self._aim = self.row[[X, Y]].copy()

    def as_observed(self) -> Person:
        """Return the person as observed by a policy."""
        x, y, vx, vy, r = (float(self.row[i]) for i in (X, Y, VX, VY, R))
        return person_from_cylinder(x, y, vx, vy, r)

    def drag(self, command: MovePerson) -> None:
        """Set the dragged position of the axis; hands are ignored."""
        self.enter("manual")
        if command.pelvis is not None:
            self._aim = np.array(self._among.walkable(*command.pelvis[:2]))
            self.row[VX], self.row[VY] = self._velocity()

    def enter(self, mode: Mode) -> None:
        """Set the motion source."""
        if mode == self.mode:
            return
        self.mode = mode
        if mode == "auto":
            self.row[GAIT] = WALKING
            self._set_course(self._among.draw_target(self._rng))
            return
        self.row[GAIT], self.row[VX], self.row[VY] = STILL, 0.0, 0.0
        self._aim = self.row[[X, Y]].copy()

    def play(self, command: SetMotion) -> None:
        """Do nothing: ``command_checks.check`` refuses the command in a reach cell."""

    def resize(self, command: SetAnthropometry) -> None:
        """Do nothing: ``command_checks.check`` refuses the command in a reach cell."""

    def _set_course(self, target: Vec) -> None:
        """Set the target of the walk [m], shape (2,)."""
        row = self.row
        offset = target - row[[X, Y]]
        left = float(np.linalg.norm(offset))
        row[TARGET_X], row[TARGET_Y], row[LEFT] = target[0], target[1], left
        row[COURSE_X], row[COURSE_Y] = offset / left if left > 0.0 else (0.0, 0.0)

    def after(self, dt: float) -> bool:
        """Move a dragged person and turn the mannequin; return whether the person moved."""
        moved = False
        if self.mode == "manual":
            step = self._velocity() * dt
            moved = bool(np.abs(step).max() > 1e-6)
            self.row[[X, Y]] += step
            self.row[VX], self.row[VY] = self._velocity()
            if self.row[AGE] == 0.0:
                self.row[PAST_SPEED] = math.hypot(self.row[VX], self.row[VY])
        vx, vy = float(self.row[VX]), float(self.row[VY])
        if math.hypot(vx, vy) > SLOW:
            turn = (math.atan2(vy, vx) - self.yaw + math.pi) % (2.0 * math.pi) - math.pi
            self.yaw += min(max(turn, -TURN_RATE * dt), TURN_RATE * dt)
        return moved

    def _velocity(self) -> Vec:
        """Return the velocity toward the drag target [m/s], shape (2,)."""
        velocity = (self._aim - self.row[[X, Y]]) / max(DRAG_LAG_S, self._among.dt)
        speed = float(np.linalg.norm(velocity))
        return np.asarray(velocity * min(1.0, DRAG_SPEED / max(speed, 1e-9)))

    def snapshot(self, clearance_m: float, *, nearest: bool) -> PersonSnapshot:
        """Return the read model of the person at a distance to the robot [m]."""
        row, among = self.row, self._among
        x, y, vx, vy = (float(row[i]) for i in (X, Y, VX, VY))
        qd = np.zeros(18)
        qd[:2] = vx, vy
        posture = frozen(rest_posture(x, y, self.yaw))
        return PersonSnapshot(
            id=self.id,
            mode=self.mode,
            q=posture,
            posture=posture,
            qd=frozen(qd),
            size=frozen(among.body),
            anthropometry=UPRIGHT,
            motion=None,
            joining=False,
            outside_area=among.is_outside(x, y),
            clearance_m=clearance_m,
            nearest=nearest,
            cylinder=CylinderSnapshot(
                x=x, y=y, vx=vx, vy=vy, radius=float(row[R]), height=among.height
            ),
        )


def live_settings(cell: Cell) -> PedestrianSettings:
    """Return the walk settings of a live cell: those of its first cylinder, without end."""
    known = pedestrian_settings(cell.cylinders[0]) if cell.cylinders else PedestrianSettings()
    return replace(known, p_still=0.0, p_go_on=AUTHORS_WALK["p_go_on"])
