"""One person of a live cell: works, acts a case study, moves as recorded, rests, or is dragged.

Going from one to the other the person moves, it never jumps; nor does its size.
"""

import math
from typing import Protocol

import numpy as np

from app.live.commands import Mode, MovePerson, SetAnthropometry, SetMotion
from app.live.people.body import LiveBody
from app.live.people.dragging import DraggedPerson
from app.live.people.work_loop import WorkLoop
from app.live.playback import PlayedMotion, is_outside
from app.live.snapshot import PersonSnapshot
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.anthropometry import percentile_body
from app.sim.human.person import Person
from app.sim.pick.cases import Case, script_of
from app.sim.primitives.primitive_library import VARIANTS

FEWER_VARIANTS = 4
"""Postures per place and hand of a person who is not the cell's own: soon made."""
THERE_M = 0.005
"""Height of the pelvis from which on it counts as arrived [m]."""


class PostureSource(Protocol):
    """What moves a person who works: a work cycle or the script of a case study."""

    def at(self, t: float) -> tuple[Vec, Vec]:
        """Return joint positions [m, rad] and speeds [m/s, rad/s] at ``t`` [s], (18,) each."""


class LivePerson:
    """Posture, speed, size and occupation of one person.

    Args:
        cell: Work cell.
        place: The same cell as this person's own: home, part of the table and of the area.
        id: Number of the person.
        seed: Seed of the person's work.
        q: Posture from which the person walks to work; None is at work from the start.
    """

    def __init__(
        self, cell: Cell, place: Cell, id: int, seed: int, q: Vec | None = None
    ) -> None:
        self.id = id
        """Number of the person."""
        self.mode: Mode = "auto"
        """Who moves the person."""
        self.body = LiveBody(place.human, cell.floor_z)
        """How large the person is."""
        self._cell, self._place, self._seed = cell, place, seed
        self._played: PlayedMotion | None = None
        self._work: PostureSource = self._new_work()
        self._t, self._joining = 0.0, q is not None
        self._limbs = DraggedPerson(cell, self._work.at(0.0)[0] if q is None else q)

    @property
    def q(self) -> Vec:
        """Joint positions [m, rad], shape (18,); the yaw counts full turns."""
        return self._limbs.q

    @property
    def size(self) -> Vec:
        """Size at this moment [m], shape (12,)."""
        return self.body.size

    def seen(self) -> Person:
        """Return the person as a policy sees it, inside the joint limits.

        The yaw lies within half a turn of home's.
        """
        q, full = self._limbs.q.copy(), 2.0 * math.pi
        q[2] -= full * round((q[2] - self._cell.human.home[2]) / full)
        q = np.clip(q, human.Q_MIN, human.Q_MAX)
        return Person(q=q, qd=self._limbs.qd, size=self.size)

    # What the person does.

    def start(self, case: Case | None) -> None:
        """Start the occupation from its beginning, at once; a dragged person stays."""
        if case is not None:
            self._work = script_of(self._cell, case)
        elif self.mode == "auto":
            self._work = self._new_work()
        self._t, self._joining = 0.0, False
        if self.mode != "manual":
            self.body.rise = self._rise()
            self._limbs.place(*self._occupation(0.0))

    def enter(self, mode: Mode) -> None:
        """Change who moves the person; ``recorded`` plays what :meth:`play` was given."""
        if mode == self.mode:
            return
        if self.mode == "recorded":
            self.body.become(None)
        self.mode, self._joining = mode, mode != "manual"
        self._limbs.place(self.q, self._limbs.qd)
        if mode == "auto":
            self._begin_work()

    def leave_case(self) -> None:
        """Go from a case study back to ordinary work."""
        self._begin_work()

    def move_to(self, place: Cell) -> None:
        """Take over another part of the table."""
        if place == self._place:
            return
        self._place = place
        if self.mode == "auto":
            self._begin_work()
        elif self.mode == "still":
            self._joining = True

    def play(self, command: SetMotion) -> None:
        """Move as recorded, from the beginning of the run, with the recorded lengths."""
        self._played = PlayedMotion(command.loaded, self._place, self._cell.human)
        self.mode = "recorded"
        self.body.become(self._played.size)
        self._join_run()

    def drag(self, command: MovePerson) -> None:
        """Aim at a dragged posture."""
        self.enter("manual")
        self._limbs.drag(command, self.size)

    def resize(self, command: SetAnthropometry) -> None:
        """Become as large as asked for."""
        asked = (command.stature, command.arms, command.shoulders)
        now = self.body.percentiles
        self.body.resize(
            *(old if new is None else new for new, old in zip(asked, now, strict=True))
        )
        if command.recorded and self.mode == "recorded" and self._played is not None:
            self.body.become(self._played.size)

    def _begin_work(self) -> None:
        self._work = self._new_work()
        self._t, self._joining = 0.0, self.mode == "auto"

    def _new_work(self) -> WorkLoop:
        worker = self._place.human
        stature, arms, shoulders = self.body.percentiles
        size = percentile_body(stature, arms, shoulders, worker.pelvis_height)
        own = self._place == self._cell and size == worker.size
        variants = VARIANTS if own else FEWER_VARIANTS
        return WorkLoop(self._place, self._seed, size, variants)

    def _join_run(self) -> None:
        self._t, self._joining = 0.0, True
        if self._played is not None:
            self._played.turn_near(float(self.q[2]))

    # Time.

    def move(self, dt: float) -> bool:
        """Move for ``dt`` [s]; return whether the person did."""
        grew = self.glide(dt)
        if self.mode in ("auto", "recorded") and not self._joining:
            self._t += dt
            self._limbs.place(*self._occupation(self._t))
            self._carry_on(dt)
            return True
        if self._joining:
            self._limbs.aim(self._occupation(self._t)[0])
        rose = self.body.rise_to(self._rise(), dt)
        moved = self._limbs.follow(dt)
        there = self.body.settled and abs(self.body.rise - self._rise()) < THERE_M
        self._joining = self._joining and not (there and self._limbs.arrived)
        return moved or rose or grew

    def glide(self, dt: float) -> bool:
        """Let the size go on changing for ``dt`` [s]; return whether it did.

        A dragged hand stays where it was put; who works begins again with the new arms.
        """
        if not self.body.glide(dt):
            return False
        if self.mode == "manual":
            self._limbs.drag(MovePerson(), self.size)
        elif self.mode == "auto" and self.body.settled and isinstance(self._work, WorkLoop):
            self._begin_work()
        return True

    def _carry_on(self, dt: float) -> None:
        """Raise or lower the pelvis; at its end a run goes back to its beginning."""
        if self.mode != "recorded" or self._played is None:
            self.body.rise_to(0.0, dt)
            return
        self.body.rise = self._rise()
        if self._t >= self._played.duration:
            self._join_run()

    def _occupation(self, t: float) -> tuple[Vec, Vec]:
        """Return posture and speed of what the person does, ``t`` [s] after it began."""
        if self.mode == "recorded" and self._played is not None:
            return self._played.at(t)
        if self.mode == "still":
            return human.rest_posture(*self._place.human.home), np.zeros(18)
        return self._work.at(t)

    def _rise(self) -> float:
        """Return how high the pelvis shall be above standing now [m]."""
        if self.mode == "recorded" and self._played is not None:
            return self._played.rise_at(self._t)
        return 0.0

    def freeze(self) -> None:
        """Forget the speed: the clock stands."""
        self._limbs.qd = self._limbs.qd * 0.0

    def view(self, clearance_m: float, *, nearest: bool) -> PersonSnapshot:
        """Return what is known of the person.

        Args:
            clearance_m: Distance of the robot [m].
            nearest: Whether nobody is nearer to it.
        """
        seen = self.seen()
        played = self._played if self.mode == "recorded" else None
        return PersonSnapshot(
            id=self.id,
            mode=self.mode,
            q=frozen(seen.q),
            posture=frozen(self._limbs.q),
            qd=frozen(seen.qd),
            size=frozen(self.size),
            anthropometry=self.body.view(),
            motion=None if played is None else played.view(self._t),
            joining=self._joining,
            outside_area=is_outside(self.q, self._cell.human),
            clearance_m=clearance_m,
            nearest=nearest,
        )


def frozen(values: Vec) -> Vec:
    """Return a copy that nobody can write to."""
    copy = np.array(values, dtype=np.float64)
    copy.setflags(write=False)
    return copy
