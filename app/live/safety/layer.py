"""Safety layer of a live world: settings, planned motion, times.

Between two control periods the layer decides how the motion of policy or inverse kinematics is
executed in the next period (docs/method.md 2.7). It is enabled at the start, with the
settings of the cell. If disabled, it states the override without applying it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from app.live.arm import LiveArm
from app.live.commands import SetSafety
from app.live.read_model import frozen
from app.live.safety.snapshot import SafetySnapshot
from app.sim.cells.cell import Cell
from app.sim.collision.checker import Shapes
from app.sim.core.arrays import Vec
from app.sim.robot.trajectory_segment import TrajectorySegment
from app.sim.safety.decision import SafetyDecision, SeparationTerms
from app.sim.safety.layer import SafetyLayer, SafetySettings, safety_settings
from app.sim.safety.separation_zone import separation_zone


class LiveSafety:
    """Safety layer of a live world, with the settings of its cell at the start."""

    def __init__(self, robot: LiveArm, cell: Cell) -> None:
        self.suspended = False
        """Whether the layer is disabled for a case study."""
        self._enabled = True
        # Decision for the next period, with the terms of S_p and the zone of the same state.
        self._decided: SafetyDecision
        self._terms: tuple[int, SeparationTerms] | None
        self._zone: Vec
        self._robot = robot
        self._layer = SafetyLayer(robot.arm, safety_settings(cell))
        self.reset()

    @property
    def on(self) -> bool:
        """Whether the robot obeys the layer."""
        return self._enabled and not self.suspended

    @property
    def settings(self) -> SafetySettings:
        """Assumptions of the layer."""
        return self._layer.settings

    @property
    def override(self) -> float:
        """Executed override of the planned motion, in [0, 1]."""
        return self._decided.override if self.on else 1.0

    def change(self, command: SetSafety) -> None:
        """Enable or disable the layer, and change its settings."""
        if command.on is not None:
            self._enabled, self.suspended = command.on, False
        changed = command.model_dump(exclude={"tag", "on"}, exclude_none=True)
        if changed:
            self._layer = SafetyLayer(self._robot.arm, replace(self.settings, **changed))

    def reset(self) -> None:
        """Set the times to zero."""
        self._moving_s = self._slowed_s = self._stopped_s = 0.0

    def count(self, dt: float) -> None:
        """Add a control period of motion [s] to the times."""
        self._moving_s += dt
        self._slowed_s += dt if self.override < 0.5 else 0.0
        self._stopped_s += dt if self.override <= 0.0 else 0.0

    def plan(self, wanted: TrajectorySegment, people: Shapes) -> TrajectorySegment:
        """Return the motion of the next period; ``wanted`` is the one without the layer."""
        robot, layer = self._robot, self._layer
        decided = layer.decide(robot.q, robot.qd, wanted.c, wanted.d, people)
        self._decided, self._terms = decided, layer.terms(decided, robot.qd, people)
        self._zone = frozen(separation_zone(robot.arm, layer.settings, robot.q, robot.qd))
        return self._executed(decided) if self.on else wanted

    def _executed(self, decided: SafetyDecision) -> TrajectorySegment:
        """Return the admitted motion as a trajectory segment with the same ends.

        Within a period of 0.05 s it differs from the admitted motion by less than 1 mrad.
        """
        q, qd, dt = self._robot.q, self._robot.qd, self._robot.dt
        c = (decided.q - q - qd * dt) / dt**2
        return TrajectorySegment(
            c=c, d=np.zeros(6), q=decided.q, qd=decided.qd, qdd=decided.qdd
        )

    def snapshot(self, ids: Sequence[int]) -> SafetySnapshot:
        """Return the decision for the present state with the terms of S_p.

        ``ids`` are those of the people, workers first.
        """
        settings, decided = self.settings, self._decided
        person, terms = (None, None) if self._terms is None else self._terms
        return SafetySnapshot(
            on=self.on,
            override=self.override,
            advised=decided.override,
            person=None if person is None else ids[person],
            link=terms.link if terms else None,
            separation=terms.separation if terms else None,
            required=terms.required if terms else None,
            person_distance=terms.human_speed * (terms.reaction_time + terms.stop_time)
            if terms
            else None,
            robot_distance=terms.robot_speed * terms.reaction_time + terms.braking
            if terms
            else None,
            margin=settings.margin,
            protective_distance=settings.protective_distance,
            use_measured_velocity=settings.use_measured_velocity,
            human_speed=settings.other_speed,
            reaction_time=settings.reaction_time,
            pfl=settings.pfl,
            stop_time=decided.stop_time,
            moving_s=self._moving_s,
            slowed_s=self._slowed_s,
            stopped_s=self._stopped_s,
            zone=self._zone,
        )
