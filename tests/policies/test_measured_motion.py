"""States near and over the limits: an answer, a flag, and a segment that leads inside."""

from dataclasses import replace

import numpy as np
import pytest

from app.errors import CheckpointMismatch
from app.policies.checkpoints import pretrained
from app.policies.inference.motion_decision import MotionDecider
from app.policies.inference.reach_policy import ReachPolicy
from app.sim.cells.cell import load_cell
from app.sim.human.person import Person
from app.sim.perception.observed_people import person_from_cylinder
from app.sim.reach.motion_types import MotionDecision, MotionQuery
from app.sim.robot.actions import ActionSettings
from app.sim.safety.layer import SafetySettings
from tests.policies.reach_actor import RandomActor
from tests.policies.untrained import overflowing_reach

CELL = load_cell("shared-workspace")
HOME, DT = np.array(CELL.robot.home_q), CELL.robot.dt
LOW, HIGH = np.array(CELL.robot.q_min), np.array(CELL.robot.q_max)
FAST, HARD = np.array(CELL.robot.qd_max), np.array(CELL.robot.qdd_max)
GOAL = np.array([0.05, 0.75, 0.31])
WALKER = person_from_cylinder(0.3, 1.6, 0.0, -0.5, 0.3)
ACTIONS = {
    "speed": ActionSettings(),
    "coefficient": ActionSettings(meaning="coefficient"),
    "one-step": ActionSettings(bounds="one-step"),
    "jerk": ActionSettings(degree=3),
}


def query(**changes: object) -> MotionQuery:
    asked = MotionQuery(
        q=HOME, qd=np.zeros(6), goal=GOAL, people=(WALKER,), safety=SafetySettings()
    )
    return replace(asked, **changes)  # type: ignore[arg-type]


def near_the_limits(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, speeds and accelerations of which about half are at or over a limit."""
    side, over = rng.choice([-1.0, 1.0], (3, 6)), rng.uniform(-0.01, 0.05, (3, 6))
    q = np.where(side[0] < 0, LOW - over[0], HIGH + over[0])
    qd, qdd = side[1] * (1.0 + over[1]) * FAST, side[2] * (1.0 + over[2]) * HARD
    some = rng.uniform(size=(3, 6)) < 0.5
    return (
        np.where(some[0], q, rng.uniform(LOW, HIGH)),
        np.where(some[1], qd, rng.uniform(-FAST, FAST)),
        np.where(some[2], qdd, rng.uniform(-HARD, HARD)),
    )


def assert_leads_inside(decision: MotionDecision, asked: MotionQuery) -> None:
    """Every joint outside is turned inward with its whole acceleration, until it is fast."""
    q, qd, segment = asked.q, asked.qd, decision.segment
    np.testing.assert_allclose(segment.q, q + DT * (qd + DT * (segment.c + DT * segment.d)))
    step = HARD * DT
    assert (np.abs(segment.qd - qd) <= step + 1e-9).all()
    inside = (q >= LOW) & (q <= HIGH)
    assert (np.abs(segment.qd) <= np.maximum(FAST, np.abs(qd) - step) + 1e-9)[inside].all()
    for above, sign in ((q > HIGH, 1.0), (q < LOW, -1.0)):
        toward = np.maximum(-FAST, sign * qd - step)
        np.testing.assert_allclose((sign * segment.qd)[above], toward[above], atol=1e-6)


@pytest.mark.parametrize("kind", ["speed", "coefficient", "one-step"])
def test_every_state_near_the_limits_has_an_answer_that_leads_inside(kind: str) -> None:
    one, rng = MotionDecider(RandomActor(action=ACTIONS[kind]), CELL), np.random.default_rng(3)
    flagged = 0
    for _ in range(300):
        q, qd, qdd = near_the_limits(rng)
        asked = query(q=q, qd=qd, qdd=qdd)
        decision = one.decide(asked)
        assert_leads_inside(decision, asked)
        over = (q < LOW) | (q > HIGH), np.abs(qd) > FAST, np.abs(qdd) > HARD
        assert len(decision.state_outside) == sum(int(part.sum()) for part in over)
        flagged += bool(decision.state_outside)
        if over[0].any():
            assert decision.unfeasible
        assert decision.safe is not None and np.isfinite(decision.safe.q).all()
        assert decision.safe.stop_time == pytest.approx(float((np.abs(qd) / HARD).max()))
    assert flagged > 250


def test_a_jerk_limited_policy_leads_inside_from_the_clamped_acceleration() -> None:
    one = MotionDecider(RandomActor(action=ACTIONS["jerk"]), CELL)
    rng, jerk = np.random.default_rng(4), np.array(CELL.robot.jerk_max)
    for _ in range(200):
        q, qd, qdd = near_the_limits(rng)
        decision = one.decide(query(q=q, qd=qd, qdd=qdd))
        segment, begun = decision.segment, np.clip(qdd, -HARD, HARD)
        np.testing.assert_allclose(2.0 * segment.c, begun)
        assert (np.abs(6.0 * segment.d) <= jerk + 1e-6).all()
        assert (np.abs(segment.qdd) <= HARD + 1e-6).all()
        for above, sign in ((q > HIGH, 1.0), (q < LOW, -1.0)):
            least = np.maximum(-HARD, sign * begun - jerk * DT)
            slow = sign * qd > -0.5 * FAST
            outward = above & slow & (sign * begun > -0.5 * HARD)
            np.testing.assert_allclose((sign * segment.qdd)[outward], least[outward], atol=1e-6)


@pytest.mark.parametrize("kind", list(ACTIONS))
@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("over", [1e-4, 0.04])
def test_a_joint_left_outside_comes_back_and_every_step_is_answered(
    kind: str, side: float, over: float
) -> None:
    """In closed loop, from full speed outward at the limit, far from everybody."""
    one = MotionDecider(RandomActor(action=ACTIONS[kind]), CELL)
    q, qd, qdd = HOME.copy(), np.zeros(6), np.zeros(6)
    q[2] = (HIGH if side > 0 else LOW)[2] + side * over
    qd[2] = side * 1.01 * FAST[2]
    first = one.decide(query(q=q, qd=qd, qdd=qdd, people=()))
    assert first.unfeasible and {one.of for one in first.state_outside} == {"limits"}
    for _ in range(60):
        decision = one.decide(query(q=q, qd=qd, qdd=qdd, people=()))
        safe = decision.safe
        assert safe is not None
        q, qd, qdd = safe.q, safe.qd, safe.qdd
    assert LOW[2] <= q[2] <= HIGH[2]


def test_monitoring_lets_a_robot_go_on_that_is_measured_a_hair_too_fast() -> None:
    """Nobody is near: a percent of noise must not brake the robot every second time."""
    one, far = (
        MotionDecider(RandomActor(), CELL),
        person_from_cylinder(-1.8, 4.0, 0.0, 0.0, 0.3),
    )
    rng = np.random.default_rng(5)
    for _ in range(60):
        qd = rng.choice([-1.0, 1.0], 6) * FAST * (1.0 + rng.normal(0.0, 0.01, 6))
        decision = one.decide(query(q=0.3 * HOME, qd=qd, people=(far,)))
        assert decision.safe is not None and decision.safe.override == 1.0
        assert (np.abs(decision.safe.qd) <= FAST + 1e-9).all()


def test_noisy_measurements_of_a_closed_loop_never_lose_a_decision() -> None:
    one = MotionDecider(ReachPolicy(pretrained.load("reach")), CELL)
    rng, q, qd = np.random.default_rng(6), HOME.copy(), np.zeros(6)
    fastest, flagged = 0.0, 0
    goals = (np.array([-0.45, 0.65, 0.15]), np.array([0.45, 0.95, 0.45]))
    for k in range(240):
        seen = qd * (1.0 + rng.uniform(-0.01, 0.01, 6))
        asked = query(q=q, qd=seen, goal=goals[k // 60 % 2], people=(), rollout=False)
        decision = one.decide(asked)
        safe = decision.safe
        assert safe is not None
        flagged += bool(decision.state_outside)
        q, qd = safe.q, safe.qd
        fastest = max(fastest, float(np.abs(qd / FAST).max()))
    assert fastest > 0.99 and flagged > 10


@pytest.mark.parametrize("joints", [[2], [0, 3], list(range(6))])
@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("kind", list(ACTIONS))
def test_a_joint_at_its_limit_at_full_speed_outward_brakes_and_is_flagged(
    kind: str, side: float, joints: list[int]
) -> None:
    one = MotionDecider(RandomActor(action=ACTIONS[kind]), CELL)
    q, qd = HOME.copy(), np.zeros(6)
    q[joints] = (HIGH if side > 0 else LOW)[joints]
    qd[joints] = side * FAST[joints]
    decision = one.decide(query(q=q, qd=qd, qdd=np.zeros(6), people=()))
    assert decision.unfeasible and decision.state_outside == ()
    slower = side * (qd - decision.segment.qd)[joints]
    most = HARD * DT if kind != "jerk" else 0.5 * np.array(CELL.robot.jerk_max) * DT**2
    np.testing.assert_allclose(slower, most[joints], rtol=1e-6)
    assert decision.safe is not None and (side * decision.safe.qd < FAST)[joints].all()


@pytest.mark.parametrize("away", [1.0, 1.25, 1.5, 1.75, 2.0])
def test_a_faster_measured_robot_needs_more_distance_and_is_never_let_run_faster(
    away: float,
) -> None:
    one, found = MotionDecider(RandomActor(), CELL), []
    for share in (1.0, 1.02, 1.05):
        qd = share * FAST * [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
        person = person_from_cylinder(0.2, away, 0.0, 0.0, 0.3)
        decision = one.decide(query(qd=qd, people=(person,)))
        assert decision.safe is not None and decision.terms is not None
        found.append(
            (decision.terms.required, decision.terms.stop_time, decision.safe.override)
        )
        assert decision.terms.robot_speed > 0.0
    required, stops, overrides = zip(*found, strict=True)
    assert required == tuple(sorted(set(required)))
    assert stops == tuple(sorted(set(stops)))
    assert overrides == tuple(sorted(overrides, reverse=True))


def test_accelerations_that_no_policy_needs_cost_no_decision() -> None:
    noisy = query(qdd=np.array([80.0, -40.0, 3.0, 0.0, 6.0, -5.01]))
    decision = MotionDecider(RandomActor(), CELL).decide(noisy)
    names = [one.field for one in decision.state_outside]
    assert [one.rsplit(".", 1)[1] for one in names] == [
        "shoulder_pan",
        "shoulder_lift",
        "wrist_2",
        "wrist_3",
    ]
    plain = MotionDecider(RandomActor(), CELL).decide(query())
    np.testing.assert_array_equal(decision.act, plain.act)


def test_the_policy_sees_a_state_over_its_limits_as_the_one_at_them() -> None:
    one, qd = MotionDecider(RandomActor(), CELL), np.zeros(6)
    qd[0], q = 1.03 * FAST[0], HOME.copy()
    q[5] = HIGH[5] + 0.03
    over = one.decide(query(q=q, qd=qd))
    at = one.decide(query(q=np.clip(q, LOW, HIGH), qd=np.clip(qd, -FAST, FAST)))
    np.testing.assert_array_equal(over.act, at.act)
    assert [one.field for one in over.state_outside] == [
        "robot.q.wrist_3",
        "robot.qd.shoulder_pan",
    ]
    assert at.state_outside == ()


def test_distances_and_stops_are_those_of_the_measured_state() -> None:
    one, q = MotionDecider(RandomActor(), CELL), HOME.copy()
    q[1] = HIGH[1] + 0.05
    inside = np.clip(q, LOW, HIGH)
    measured, clamped = one.decide(query(q=q)), one.decide(query(q=inside))
    assert measured.person_weights[0].separation != clamped.person_weights[0].separation
    layer = measured.safe
    assert layer is not None and measured.terms is not None
    assert measured.terms.separation == pytest.approx(
        measured.person_weights[0].separation, abs=1e-9
    )
    np.testing.assert_allclose(measured.segment.q - q, layer.q - q, atol=0.01)


@pytest.mark.parametrize("away", [6.0, 40.0, 99.0])
@pytest.mark.parametrize("known_by", ["cylinder", "joints"])
def test_far_people_are_seen_at_five_metres_and_kept_where_they_are(
    away: float, known_by: str
) -> None:
    one = MotionDecider(RandomActor(), CELL)
    people: dict[float, Person] = {}
    for x in (away, 5.0):
        person = person_from_cylinder(x, 0.2 * x, 0.0, 0.0, 0.3)
        people[x] = person if known_by == "cylinder" else replace(person, cylinder=None)
    far, near = (one.decide(query(people=(people[x],))) for x in (away, 5.0))
    np.testing.assert_array_equal(far.act, near.act)
    assert far.person_weights[0].separation > near.person_weights[0].separation + 0.9 * (
        away - 5.0
    )
    assert far.terms is not None
    assert far.terms.separation == pytest.approx(far.person_weights[0].separation, abs=1e-9)


def test_a_wide_cylinder_stops_the_robot_however_far_its_axis_is() -> None:
    one = MotionDecider(RandomActor(), CELL)
    wide = person_from_cylinder(20.0, 3.0, 0.0, 0.0, 25.0)
    decision = one.decide(query(people=(wide,), qd=np.full(6, 0.2)))
    assert decision.safe is not None and decision.safe.override == 0.0
    assert decision.person_weights[0].separation < 0.0


def test_a_policy_whose_actions_are_not_finite_gives_no_segment():
    one = MotionDecider(ReachPolicy(overflowing_reach()), CELL)
    with np.errstate(all="ignore"), pytest.raises(CheckpointMismatch, match="action is"):
        one.decide(query())
