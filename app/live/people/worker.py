"""One 18-DoF person of a live cell and the sources of its motion.

Sources are the work loop, the script of a case study, a recording, rest and dragging. Posture
and size change continuously between them.
"""

import math
from collections.abc import Callable
from concurrent.futures import Future

import numpy as np

from app.live.commands import Mode, MovePerson, SetAnthropometry, SetMotion
from app.live.people.anthropometry import LiveAnthropometry
from app.live.people.dragging import DraggedPerson
from app.live.people.work_loop import WorkLoop
from app.live.playback import PlayedMotion, is_outside
from app.live.read_model import frozen
from app.live.snapshot import PersonSnapshot
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.anthropometry import BodySize, percentile_body
from app.sim.human.person import Person
from app.sim.people.reach_script import ReachScript
from app.sim.pick.cases import Case, script_of
from app.sim.primitives.primitive_library import VARIANTS

FEWER_VARIANTS = 4
"""Keyframes per place and hand of people other than the worker of the cell."""
THERE_M = 0.005
"""Tolerance of the pelvis height at arrival [m]."""


class LiveWorker:
    """Posture, speed, size and motion source of one person.

    Args:
        place: The cell restricted to this person: home, stations and walking area.
        build: Begins to build the work loop of a place, seed, size and number of variants.
        q: Initial posture [m, rad], shape (18,); None: already at work.
    """

    def __init__(
        self,
        cell: Cell,
        place: Cell,
        id: int,
        seed: int,
        build: Callable[[Cell, int, BodySize, int], Future[WorkLoop]],
        q: Vec | None = None,
    ) -> None:
        self.id = id
        """Number of the person."""
        self.mode: Mode = "auto"
        """Motion source."""
        self.body = LiveAnthropometry(place.human, cell.floor_z)
        """Body dimensions."""
        self._cell, self._place, self._seed = cell, place, seed
        self._played: PlayedMotion | None = None
        self._build = build
        self._work: WorkLoop | ReachScript | None = None
        self._building: Future[WorkLoop] | None = None
        self.begin_work()
        self._joining = q is not None
        self._limbs = DraggedPerson(cell, self._source_at(0.0)[0] if q is None else q)

    @property
    def q(self) -> Vec:
        """Joint positions [m, rad], shape (18,); the yaw counts full turns."""
        return self._limbs.q

    @property
    def qd(self) -> Vec:
        """Joint speeds [m/s, rad/s], shape (18,)."""
        return self._limbs.qd

    @property
    def size(self) -> Vec:
        """Present body lengths [m], shape (12,)."""
        return self.body.size

    def as_observed(self) -> Person:
        """Return the person as observed by a policy, inside the joint limits.

        The yaw is within half a turn of the home yaw.
        """
        q, full = self.q.copy(), 2.0 * math.pi
        q[2] -= full * round((q[2] - self._cell.human.home[2]) / full)
        return Person(q=np.clip(q, human.Q_MIN, human.Q_MAX), qd=self.qd, size=self.size)

    # Motion source.

    def start(self, case: Case | None) -> None:
        """Restart work or the script of a case study; a dragged person stays."""
        if case is not None:
            self._work, self._building = script_of(self._cell, case), None
        elif self.mode == "auto":
            self.begin_work()
        self._t, self._joining = 0.0, False
        if self.mode != "manual":
            self.body.rise = self._rise()
            self._limbs.place(*self._source_at(0.0))

    def enter(self, mode: Mode) -> None:
        """Set the motion source; ``recorded`` continues the recording of :meth:`play`."""
        if mode == self.mode:
            return
        if self.mode == "recorded":
            self.body.use_recorded(None)
        self.mode, self._joining = mode, mode != "manual"
        self._limbs.place(self.q, self._limbs.qd)
        if mode == "auto":
            self.begin_work()
        if mode != "manual":
            self._limbs.turn_near(float(self._source_at(self._t)[0][2]))

    def move_to(self, place: Cell) -> None:
        """Set another home and other stations."""
        if place == self._place:
            return
        self._place = place
        if self.mode == "auto":
            self.begin_work()
        elif self.mode == "still":
            self._joining = True

    def play(self, command: SetMotion) -> None:
        """Play a recorded run from its start, with the recorded body lengths."""
        self._played = PlayedMotion(command.loaded, self._place, self._cell.human)
        self.mode = "recorded"
        self.body.use_recorded(self._played.size)
        self._join_run()

    def drag(self, command: MovePerson) -> None:
        """Set dragged targets."""
        self.enter("manual")
        self._limbs.drag(command, self.size)

    def resize(self, command: SetAnthropometry) -> None:
        """Change the body dimensions."""
        requested = (command.stature, command.arms, command.shoulders)
        now = self.body.percentiles
        self.body.resize(
            *(old if new is None else new for new, old in zip(requested, now, strict=True))
        )
        if command.recorded and self.mode == "recorded" and self._played is not None:
            self.body.use_recorded(self._played.size)

    def begin_work(self) -> None:
        """Start the work loop for the present dimensions and place.

        Until it is built, the person goes home and rests.
        """
        worker = self._place.human
        stature, arms, shoulders = self.body.percentiles
        size = percentile_body(stature, arms, shoulders, worker.pelvis_height)
        own = self._place == self._cell and size == worker.size
        wanted = (self._place, self._seed, size, VARIANTS if own else FEWER_VARIANTS)
        self._t, self._joining = 0.0, self.mode == "auto"
        if self._building is not None:
            self._building.cancel()
            self._building = None
        if isinstance(self._work, WorkLoop) and self._work.arguments == wanted:
            self._work.restart()
            return
        self._work, self._building = None, self._build(*wanted)
        self._take_work()

    def _take_work(self) -> None:
        """Start the work loop that was being built, once it is there."""
        if self._building is not None and self._building.done() and self.mode == "auto":
            built, self._building = self._building, None
            self._work = built.result()
            self._t, self._joining = 0.0, True

    def _join_run(self) -> None:
        self._t, self._joining = 0.0, True
        if self._played is not None:
            self._played.turn_near(float(self.q[2]))

    # Time.

    def move(self, dt: float) -> bool:
        """Move for ``dt`` [s]; return whether the person moved."""
        self._take_work()
        resized = self.advance_size(dt)
        if self.mode in ("auto", "recorded") and not self._joining:
            self._t += dt
            self._limbs.place(*self._source_at(self._t))
            self._after_source(dt)
            return True
        if self._joining:
            self._limbs.aim(self._source_at(self._t)[0])
        rose = self.body.rise_to(self._rise(), dt)
        moved = self._limbs.follow(dt)
        there = self.body.settled and abs(self.body.rise - self._rise()) < THERE_M
        self._joining = self._joining and not (there and self._limbs.arrived)
        return moved or rose or resized

    def advance_size(self, dt: float) -> bool:
        """Continue a change of size for ``dt`` [s]; return whether there was one.

        Dragged hands keep their targets; work restarts with the new dimensions.
        """
        if not self.body.advance_size(dt):
            return False
        is_scripted = isinstance(self._work, ReachScript)
        if self.mode == "manual":
            self._limbs.drag(MovePerson(), self.size)
        elif self.mode == "auto" and self.body.settled and not is_scripted:
            self.begin_work()
        return True

    def _after_source(self, dt: float) -> None:
        """Update the pelvis height; restart a recorded run at its end."""
        if self.mode != "recorded" or self._played is None:
            self.body.rise_to(0.0, dt)
            return
        self.body.rise = self._rise()
        if self._t >= self._played.duration:
            self._join_run()

    def _source_at(self, t: float) -> tuple[Vec, Vec]:
        """Return posture and speed of the motion source at ``t`` [s]."""
        if self.mode == "recorded" and self._played is not None:
            return self._played.at(t)
        if self.mode == "still" or self._work is None:
            return human.rest_posture(*self._place.human.home), np.zeros(18)
        return self._work.at(t)

    def _rise(self) -> float:
        """Return the target height of the pelvis relative to standing [m]."""
        if self.mode == "recorded" and self._played is not None:
            return self._played.rise_at(self._t)
        return 0.0

    def freeze(self) -> None:
        """Set the speed to 0 while the clock is paused."""
        self._limbs.qd = self._limbs.qd * 0.0

    def snapshot(self, clearance_m: float, *, nearest: bool) -> PersonSnapshot:
        """Return the read model of the person at a distance to the robot [m]."""
        observed = self.as_observed()
        played = self._played if self.mode == "recorded" else None
        return PersonSnapshot(
            id=self.id,
            mode=self.mode,
            q=frozen(observed.q),
            posture=frozen(self._limbs.q),
            qd=frozen(observed.qd),
            size=frozen(self.size),
            anthropometry=self.body.snapshot(),
            motion=None if played is None else played.snapshot(self._t),
            joining=self._joining,
            outside_area=bool(is_outside(self.q, self._cell.human)),
            clearance_m=clearance_m,
            nearest=nearest,
        )
