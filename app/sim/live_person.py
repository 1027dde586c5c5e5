"""The person of a live cell: works by itself, acts a case study, or is dragged.

Going from one to the other the person moves, it never jumps.
"""

from app.sim.cases import Case, script_of
from app.sim.cells import Cell
from app.sim.commands import Mode, MoveHuman
from app.sim.dragged_person import DraggedPerson
from app.sim.ports import Vec
from app.sim.work_cycle import Script, WorkCycle


class LivePerson:
    """Posture, speed and script of one person.

    Args:
        cell: Work cell.
        seed: Seed of the person's work.
    """

    def __init__(self, cell: Cell, seed: int) -> None:
        self._cell, self._seed = cell, seed
        self.mode: Mode = "auto"
        """Who moves the person."""
        self._start_script(None)
        self._body = DraggedPerson(cell, self._script.at(0.0)[0])

    @property
    def q(self) -> Vec:
        """Joint positions [m, rad], shape (18,)."""
        return self._body.q

    @property
    def qd(self) -> Vec:
        """Joint speeds [m/s, rad/s], shape (18,)."""
        return self._body.qd

    def _start_script(self, case: Case | None) -> None:
        self._script: WorkCycle | Script = (
            WorkCycle(self._cell, self._seed) if case is None else script_of(self._cell, case)
        )
        self._t, self._joining = 0.0, False

    def start(self, case: Case | None) -> None:
        """Start the work cycle or a case study from its beginning; a dragged person stays."""
        self._start_script(case)
        if self.mode == "auto":
            self._body.place(*self._script.at(0.0))

    def enter(self, mode: Mode) -> None:
        """Change who moves the person."""
        if mode != self.mode:
            self.mode, self._joining = mode, mode == "auto"
            self._body.place(self.q, self.qd)

    def leave_case(self) -> None:
        """Go from a case study back to ordinary work."""
        self._start_script(None)
        self._joining = self.mode == "auto"

    def drag(self, command: MoveHuman) -> None:
        """Aim at a dragged posture."""
        self.enter("manual")
        self._body.drag(command)

    def move(self, dt: float) -> bool:
        """Move for ``dt`` [s]; return whether the person did."""
        if self.mode == "auto" and not self._joining:
            self._t += dt
            self._body.place(*self._script.at(self._t))
            return True
        if self._joining:
            self._body.aim(self._script.at(self._t)[0])
        moved = self._body.follow(dt)
        self._joining = self._joining and not self._body.arrived
        return moved

    def freeze(self) -> None:
        """Forget the speed: the clock stands."""
        self._body.qd = self._body.qd * 0.0
