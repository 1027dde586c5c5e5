"""A policy without learning, for tests of what a policy drives: straight joint moves.

It values a candidate by the way to go and by how near a hand is to it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.person import Person
from app.sim.pick.kernels.grasp import DESCEND, LIFT, GraspRules
from app.sim.pick.task_policy import (
    FRESH,
    NOT_BEGUN,
    Candidate,
    ChoiceTerms,
    Decision,
    MovedPerson,
    PickProgress,
    RiskMap,
)
from app.sim.robot.actions import ActionSettings
from app.sim.robot.kernels import kinematics
from app.sim.scene.scene import arm_of


class StraightPolicy:
    checkpoint = "0" * 64
    title = "straight moves"
    action = ActionSettings()
    grasp = GraspRules()
    observed_people = 2

    def __init__(self, cell: Cell) -> None:
        self.cell, self.cell_sha256 = cell.name, cell.sha256
        self._arm, self._size = arm_of(cell), cell.body

    def decide(
        self,
        q: Vec,
        qd: Vec,
        people: Sequence[Person],
        candidates: Sequence[Candidate],
        *,
        previous: str | None = None,
        progress: PickProgress = NOT_BEGUN,
        time_left_s: float = 10.0,
        objective: str = "value",
    ) -> Decision:
        goals = np.array([candidate.position for candidate in candidates])
        ids = [candidate.id for candidate in candidates]
        last = ids.index(previous) if previous in ids else None
        wanted = goals.copy()
        if last is not None and progress.phase == DESCEND:
            wanted[last, 2] -= self.grasp.depth
        arm = self._arm
        postures, reachable = kinematics.ik_vertical_batch(arm.lengths, arm.limits, wanted)
        hands = [np.full(3, np.inf)]
        for person in people:
            size = self._size if person.size is None else person.size
            hands.extend(human.palms(person.q, size))
        near = np.linalg.norm(goals[:, None] - np.stack(hands), axis=2).min(axis=1)
        values = 4.0 - np.abs(postures - q).max(axis=1) - 4.0 * np.exp(-((near / 0.2) ** 2))
        index = int(values.argmax())
        if last is not None and progress.phase == LIFT:
            index = last
        speed = np.clip(2.5 * (postures - q), -arm.limits.qd_max, arm.limits.qd_max)
        return Decision(
            chosen=candidates[index].id,
            index=index,
            values=tuple(float(value) for value in values),
            actions=(speed / arm.limits.qd_max)[:, :5].astype(np.float32),
            qd_target=speed,
            reachable=tuple(bool(found) for found in reachable),
            outside=(),
            outside_candidates=((),) * len(candidates),
            checkpoint=self.checkpoint,
            elapsed_ms=0.0,
        )

    def risk_map(
        self,
        q: Vec,
        qd: Vec,
        people: Sequence[Person],
        candidates: Sequence[Candidate],
        moved: MovedPerson,
        *,
        terms: ChoiceTerms = FRESH,
    ) -> RiskMap:
        found = []
        for posture in moved.q:
            there = list(people)
            there[moved.index] = replace(people[moved.index], q=posture)
            found.append(self.decide(q, qd, there, candidates, previous=terms.previous))
        return RiskMap(
            chosen=np.array([one.index for one in found]),
            value=np.array([one.values[one.index] for one in found]),
            success=None,
            contact=None,
            clearance_m=np.ones(len(found)),
            outside=np.zeros(len(found), dtype=np.bool_),
            elapsed_ms=0.0,
        )
