"""The people of a live reach cell: none to four walking cylinders, or who drags them.

They walk as METHOD 2.1 says, on and on: nobody stands still for a whole episode, since episodes
of the robot follow each other without a break, and whoever stays at a target goes on after a
while. A visitor may give all of them one speed, let one stand, or drag one; a dragged cylinder
follows with bounded speed and never jumps, so that the velocity a policy sees is the true one.
They avoid neither each other nor the robot.

Deviates: p_still is 0, and p_go_on of the authors' code (0.01 per period) holds; METHOD 2.1 has
both per episode.
"""

import math
from collections.abc import Iterator
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
from app.live.people.worker import frozen
from app.live.snapshot import AnthropometrySnapshot, CylinderSnapshot, PersonSnapshot
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
"""Greatest speed of a cylinder that is dragged [m/s]."""
DRAG_LAG_S = 0.12
"""Time constant with which it follows [s]."""
TURN_RATE = 4.0
"""How fast somebody turns where they walk to [rad/s]; only seen, never computed with."""
SLOW = 0.05
"""Speed below which nobody turns [m/s]."""
START_TRIES = 60
"""Places drawn for somebody who comes in."""
START_ROOM_M = 0.8
"""Distance from the robot at which people begin [m]."""
BESIDE = 0.9
"""Distance of the axes of two people that leaves room at the start [m]."""
DRAG_ROOM = 0.6
"""How far beyond the walking area somebody may be dragged [m]."""
UPRIGHT = AnthropometrySnapshot(
    stature=50.0,
    arms=50.0,
    shoulders=50.0,
    recorded=False,
    stature_m=MEDIAN.stature,
    trunk_m=MEDIAN.trunk,
    arm_m=0.5 * (MEDIAN.arm("r") + MEDIAN.arm("l")),
    shoulders_m=MEDIAN.clavicle_r + MEDIAN.clavicle_l,
)
"""The size of the mannequin inside a cylinder."""


class LiveWalkers:
    """The people of one live reach cell; row ``id`` of each array is that person's.

    Args:
        cell: Work cell whose people, if any, are cylinders.
        seed: Seed of their walks.
    """

    def __init__(self, cell: Cell, seed: int) -> None:
        self._cell, self._seed = cell, seed
        self._arm, self._shared = arm_of(cell), people_of(cell)
        self.robot_q = np.array(self._arm.home)
        """Where the robot is [rad], shape (6,); who comes in does so away from it."""
        settings = live_settings(cell)
        self._rules = pedestrian_rules([settings] * MAX_PEOPLE)
        self._own_kind = float(self._rules.rows[0, KIND])
        self.height = max([one.height for one in cell.cylinders], default=2.0)
        """Height of the cylinders [m]."""
        self.speed: float | None = None
        """Speed that a visitor gave all of them [m/s]; None as METHOD 2.1."""
        self._state = pedestrian_state(1, MAX_PEOPLE)
        self._drawn = np.zeros((MAX_PEOPLE, RADIUS - SPEED))
        self._episode = 0
        self._people: dict[int, LiveWalker] = {}
        for id in range(len(cell.people)):
            self._let_in(id)

    def __iter__(self) -> Iterator["LiveWalker"]:
        return iter(self._people.values())

    def __len__(self) -> int:
        return len(self._people)

    def __getitem__(self, id: int) -> "LiveWalker":
        return self._people[id]

    @property
    def ids(self) -> tuple[int, ...]:
        """Ids of the people who are there, in order."""
        return tuple(self._people)

    @property
    def rows(self) -> Vec:
        """State of those who are there, as the kernels keep it, shape (n, N_STATE)."""
        return self._state.rows[0, list(self._people)]

    @property
    def cylinders(self) -> Vec:
        """x, y and radius of those who are there [m], shape (n, 3)."""
        return self.rows[:, [X, Y, R]]

    @property
    def bodies(self) -> HumanGeometry:
        """Where they are; nobody has joints."""
        return HumanGeometry(np.zeros((0, 18)), np.zeros((0, N_SIZE)), self.cylinders)

    def restart(self) -> None:
        """Let everyone who walks begin again somewhere; who is dragged or stands stays."""
        for one in self:
            if one.mode == "auto":
                self._place(one.id)

    def change(self, command: AddPerson | RemovePerson) -> None:
        """Let people come and leave as a command says."""
        ids = people_after(command, self.ids)
        for id in ids:
            if id not in self._people:
                self._let_in(id)
        self._people = {id: self._people[id] for id in ids}

    def move(self, dt: float) -> None:
        """Move everyone for ``dt`` [s]."""
        for one in self:
            advance_pedestrian(self._rules, self._state, 0, one.id, dt)
            one.after(dt)

    def move_while_paused(self, dt: float) -> bool:
        """Move whoever is dragged; return whether anybody moved."""
        moved = [one.after(dt) for one in self if one.mode == "manual"]
        return any(moved)

    def set_speed(self, speed: float | None) -> None:
        """Let all walk with one speed [m/s], or as METHOD 2.1 says."""
        self.speed = speed
        for one in self:
            self._pace(one.id)

    def _let_in(self, id: int) -> None:
        self._people[id] = LiveWalker(self, id, self._state.rows[0, id])
        self._place(id)

    def _place(self, id: int) -> None:
        """Draw place, way and the two functions of somebody, away from robot and others."""
        others = [one.row for one in self if one.id != id]
        self._rules.rows[id, KIND] = self._own_kind
        for _ in range(START_TRIES):
            self._episode += 1
            stream = np.zeros(1, dtype=np.uint64)
            start_stream(self._seed, 0, self._episode, stream)
            start_pedestrian(self._rules, self._state, 0, id, stream)
            row = self._state.rows[0, id]
            apart = all(math.hypot(row[X] - o[X], row[Y] - o[Y]) > BESIDE for o in others)
            gap = pedestrian_distances(
                self._arm, self._shared, self.robot_q, row[None, [X, Y, R]]
            )
            if apart and gap[0] >= START_ROOM_M:
                break
        self._drawn[id] = self._state.rows[0, id, SPEED:RADIUS]
        self._pace(id)
        self._people[id].placed()

    def _pace(self, id: int) -> None:
        """Let somebody walk with the speed that holds for all, or that of its own function."""
        rule, speed = self._rules.rows[id], self._state.rows[0, id, SPEED:RADIUS]
        if self.speed is None:
            rule[KIND], speed[:] = self._own_kind, self._drawn[id]
        else:
            rule[KIND], rule[FIXED] = FIXED_SPEED, self.speed
            speed[:] = 0.0
            speed[MIDDLE] = self.speed

    def draw_target(self, rng: np.random.Generator) -> Vec:
        """Draw a point of the walking area [m], shape (2,)."""
        walk = live_settings(self._cell)
        return rng.uniform([walk.x_min, walk.y_min], [walk.x_max, walk.y_max])

    def walkable(self, x: float, y: float) -> tuple[float, float]:
        """Return the point nearest to (x, y) [m] where somebody may be dragged to."""
        walk = live_settings(self._cell)
        return (
            min(max(x, walk.x_min - DRAG_ROOM), walk.x_max + DRAG_ROOM),
            min(max(y, walk.y_min - DRAG_ROOM), walk.y_max + DRAG_ROOM),
        )

    def is_outside(self, x: float, y: float) -> bool:
        """Whether (x, y) [m] is outside the walking area."""
        walk = live_settings(self._cell)
        return not (walk.x_min <= x <= walk.x_max and walk.y_min <= y <= walk.y_max)

    @property
    def body(self) -> Vec:
        """Size of the mannequin inside a cylinder [m], shape (12,)."""
        return self._cell.body


class LiveWalker:
    """One walking cylinder, on its own row of the walkers' state.

    Args:
        among: The people it belongs to.
        id: Number of the person.
        row: Its state, shape (N_STATE,); changed in place.
    """

    def __init__(self, among: LiveWalkers, id: int, row: Vec) -> None:
        self._among, self.id, self.row = among, id, row
        self.mode: Mode = "auto"
        """Who moves the person."""
        self.yaw = -0.5 * math.pi
        """Where the mannequin faces [rad]."""
        self._aim = np.zeros(2)
        self._rng = np.random.default_rng(id)

    def placed(self) -> None:
        """Face where it walks; called after it was put somewhere."""
        self.yaw = math.atan2(self.row[COURSE_Y], self.row[COURSE_X])
        self._aim = self.row[[X, Y]].copy()

    def seen(self) -> Person:
        """Return the person as a policy sees it."""
        x, y, vx, vy, r = (float(self.row[i]) for i in (X, Y, VX, VY, R))
        return person_from_cylinder(x, y, vx, vy, r)

    def drag(self, command: MovePerson) -> None:
        """Follow a dragged pelvis; a cylinder has no hands."""
        self.enter("manual")
        if command.pelvis is not None:
            self._aim = np.array(self._among.walkable(*command.pelvis[:2]))
            self._head_for_aim(self.yaw)

    def enter(self, mode: Mode) -> None:
        """Change who moves the person."""
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
        """Nothing: ``commands.check`` refuses it in a reach cell."""

    def resize(self, command: SetAnthropometry) -> None:
        """Nothing: ``commands.check`` refuses it in a reach cell."""

    def _set_course(self, target: Vec) -> None:
        """Walk to a point [m], shape (2,), from now on."""
        row = self.row
        way = target - row[[X, Y]]
        left = float(np.linalg.norm(way))
        row[TARGET_X], row[TARGET_Y], row[LEFT] = target[0], target[1], left
        row[COURSE_X], row[COURSE_Y] = way / left if left > 0.0 else (0.0, 0.0)

    def after(self, dt: float) -> bool:
        """Take the step of a dragged person and turn; return whether it was one."""
        moved = False
        if self.mode == "manual":
            step = self._velocity() * dt
            moved = bool(np.abs(step).max() > 1e-6)
            self.row[X] += step[0]
            self.row[Y] += step[1]
            self.row[VX], self.row[VY] = self._velocity()
            if self.row[AGE] == 0.0:
                self.row[PAST_SPEED] = math.hypot(self.row[VX], self.row[VY])
        vx, vy = float(self.row[VX]), float(self.row[VY])
        if math.hypot(vx, vy) > SLOW:
            turn = (math.atan2(vy, vx) - self.yaw + math.pi) % (2.0 * math.pi) - math.pi
            self.yaw += min(max(turn, -TURN_RATE * dt), TURN_RATE * dt)
        return moved

    def _velocity(self) -> Vec:
        """Return the velocity toward where it is dragged [m/s], shape (2,)."""
        way = self._aim - self.row[[X, Y]]
        speed = float(np.linalg.norm(way)) / DRAG_LAG_S
        return np.asarray(way / DRAG_LAG_S * min(1.0, DRAG_SPEED / max(speed, 1e-9)))

    def _head_for_aim(self, yaw: float) -> None:
        self.row[VX], self.row[VY] = self._velocity()
        self.yaw = yaw

    def view(self, clearance_m: float, *, nearest: bool) -> PersonSnapshot:
        """Return what is known of the person.

        Args:
            clearance_m: Distance of the robot [m].
            nearest: Whether nobody is nearer to it.
        """
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
    """Return how somebody walks in a live cell: as its first person, but without end."""
    known = pedestrian_settings(cell.cylinders[0]) if cell.cylinders else PedestrianSettings()
    return replace(known, p_still=0.0, p_go_on=AUTHORS_WALK["p_go_on"])
