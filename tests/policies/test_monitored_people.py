"""The safety layer of a decision monitors all people, seen by the policy or not."""

import numpy as np
import pytest

from app.policies.inference.motion_decision import MotionDecider
from app.sim.cells.cell import load_cell
from app.sim.human import model as human
from app.sim.human.person import Person
from app.sim.perception.observed_people import person_from_cylinder
from app.sim.reach.motion_types import MotionDecision, MotionQuery
from app.sim.robot.actions import ActionSettings
from app.sim.safety.layer import SafetySettings
from tests.policies.reach_actor import RandomActor

CELL = load_cell("shared-workspace")
GOAL = np.array([0.05, 0.75, 0.31])


def people_near(rng: np.random.Generator) -> list[Person]:
    """Six people around the robot, one of them given by joint angles."""
    far, angle = rng.uniform(1.0, 2.0, 6), rng.uniform(-np.pi, np.pi, 6)
    x, y = far * np.cos(angle), far * np.sin(angle)
    people = [
        person_from_cylinder(x[i], y[i], *rng.uniform(-2.0, 2.0, 2), 0.3, measured=i > 1)
        for i in range(5)
    ]
    posture = human.rest_posture(rng.uniform(-1.0, 1.0), 1.3, -0.5 * np.pi)
    return [*people[:3], Person(q=posture, qd=np.zeros(18)), *people[3:]]


@pytest.mark.parametrize("as_measured", [False, True])
def test_override_beside_many_is_the_lowest_beside_one_of_them(as_measured: bool) -> None:
    decider = MotionDecider(RandomActor(action=ActionSettings()), CELL)
    settings = SafetySettings(use_measured_velocity=as_measured)
    rng, lowered_by = np.random.default_rng(7), set[int | None]()

    def decided(people: list[Person], observed: list[Person] | None) -> MotionDecision:
        return decider.decide(
            MotionQuery(
                q=q,
                qd=qd,
                goal=GOAL,
                people=people,
                observed=observed,
                rollout=False,
                safety=settings,
            )
        )

    for _ in range(40):
        q = np.array([*rng.uniform([-1.0, -2.2, 0.5], [1.0, -1.0, 1.8]), 0.0, 0.0, 0.0])
        qd = np.array([*rng.uniform(-1.0, 1.0, 3), 0.0, 0.0, 0.0])
        crowd = people_near(rng)
        for seen in ([], crowd[:2]):
            beside = decided(seen, crowd)
            each = [decided(seen, [one]) for one in crowd]
            assert beside.safe is not None
            overrides = [one.safe.override for one in each if one.safe is not None]
            assert beside.safe.override == min(overrides)
            if beside.safe.override < 1.0:
                assert beside.terms_of is not None
                assert overrides[beside.terms_of] < 1.0
                lowered_by.add(beside.terms_of)
        same = decided(crowd[:4], None), decided(crowd[:4], crowd[:4])
        assert same[0].safe is not None and same[1].safe is not None
        assert same[0].safe.override == same[1].safe.override
        assert (same[0].terms, same[0].terms_of) == (same[1].terms, same[1].terms_of)
    assert {0, 1, 2, 3, 4, 5} == lowered_by
