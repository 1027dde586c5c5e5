"""The next trajectory segment: as in training, interpolated, monitored; and what is refused."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.errors import CheckpointMismatch, GoalOutside, InvalidInput
from app.policies.checkpoints import pretrained
from app.policies.inference.controllers import controller_of
from app.policies.inference.motion_decision import MotionDecider
from app.policies.inference.reach_policy import ReachPolicy
from app.sim.cells.cell import load_cell
from app.sim.human import model as human
from app.sim.human.person import Person
from app.sim.people.kernels.pedestrian import (
    GROWTH,
    N_PAST,
    PAST_RADIUS,
    PAST_SPEED,
    VX,
    VY,
    R,
    X,
    Y,
)
from app.sim.perception.observed_people import person_from_cylinder
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.goal_sets import halton_targets
from app.sim.reach.motion_types import MotionDecision, MotionQuery
from app.sim.robot.actions import ActionSettings
from app.sim.safety.layer import SafetySettings
from tests.policies.reach_actor import RandomActor
from tests.sim.driven_batches import drive

MEASURED_VELOCITY = SafetySettings(use_measured_velocity=True)
CELL = load_cell("shared-workspace")
HOME = np.array(CELL.robot.home_q)
GOAL = np.array([0.05, 0.75, 0.31])
FAR_PERSON = person_from_cylinder(-1.5, 1.9, 0.3, 0.0, 0.3)


def decider(goals: str = "grid", **other: Any) -> MotionDecider:
    return MotionDecider(RandomActor(goals, **other), CELL)


def query(**changes: Any) -> MotionQuery:
    asked = MotionQuery(q=HOME, qd=np.zeros(6), goal=GOAL, people=(FAR_PERSON,))
    return replace(asked, **changes)


def driven(n_envs: int, people: tuple[str, ...], **other: Any) -> ReachBatch:
    """A batch some periods into its episodes."""
    settings = ReachSettings(people=people, goals="box", **other)
    return drive(ReachBatch(CELL, n_envs, 7, settings), 25, seed=8, auto_reset=False)


def query_of(batch: ReachBatch, e: int) -> MotionQuery:
    """Return the query with the state of one environment."""
    state, rows = batch.state, batch.state.people
    people = [
        Person(q=q.copy(), qd=qd.copy()) for q, qd in zip(rows.q[e], rows.qd[e], strict=True)
    ]
    for walker in rows.walkers.rows[e]:
        people.append(person_from_cylinder(*walker[[X, Y, VX, VY, R, GROWTH]]))
    return MotionQuery(
        q=state.q[e].copy(),
        qd=state.qd[e].copy(),
        qdd=state.qdd[e].copy(),
        goal=state.goal[e].copy(),
        people=people,
        time_left_s=float(state.time_left[e]),
    )


def with_history(batch: ReachBatch, e: int) -> MotionQuery:
    """Return the query of one environment with the history of its pedestrians."""
    asked, rows = query_of(batch, e), batch.state.people.walkers.rows[e]
    past = [
        np.stack([row[k : k + N_PAST] for k in (PAST_RADIUS, PAST_SPEED)], axis=1)[1:]
        for row in rows
    ]
    people = [replace(one, past=of) for one, of in zip(asked.people, past, strict=True)]
    return replace(asked, people=people)


@pytest.mark.parametrize("mode", ["interpolated", "direct"])
@pytest.mark.parametrize(
    "people", [(), ("walker",), ("walker", "constant"), ("worker", "walker")]
)
def test_one_state_gives_the_action_and_segment_of_training(
    people: tuple[str, ...], mode: str
) -> None:
    batch, actor = driven(6, people), RandomActor()
    running = np.flatnonzero(batch.state.outcome == 0)
    expected, decide = controller_of(actor, mode).acts(batch), MotionDecider(actor, CELL).decide
    found = {int(e): decide(replace(query_of(batch, e), inference_mode=mode)) for e in running}
    clear, distance = batch.state.clear.copy(), batch.state.distance.copy()
    batch.step(expected, auto_reset=False)
    assert len(found) > 2
    for e, decision in found.items():
        np.testing.assert_allclose(decision.act, expected[e], atol=2e-6)
        np.testing.assert_allclose(decision.segment.q, batch.state.q[e], atol=1e-7)
        np.testing.assert_allclose(decision.segment.qd, batch.state.qd[e], atol=1e-6)
        np.testing.assert_allclose(decision.clearance, clear[e], atol=1e-9)
        assert decision.distance == pytest.approx(distance[e], abs=1e-12)


def test_people_may_come_in_any_order() -> None:
    batch = driven(4, ("worker", "walker", "constant"))
    asked, one = query_of(batch, 1), decider()
    turned = replace(asked, people=asked.people[::-1])
    for weighting in ("nearest", "distance-weighted"):
        first = one.decide(replace(asked, person_weighting=weighting))
        second = one.decide(replace(turned, person_weighting=weighting))
        np.testing.assert_allclose(first.act, second.act, atol=1e-12)
        for here, there in zip(first.person_weights, second.person_weights[::-1], strict=True):
            assert here.separation == there.separation
            assert here.weight == pytest.approx(there.weight, abs=1e-12)
        assert first.nearest_person == 2 - second.nearest_person


def test_distance_weighted_actions_equal_those_of_the_controller() -> None:
    batch, actor = driven(5, ("walker", "constant", "fixed-speed")), RandomActor()
    expected = controller_of(actor, "distance-weighted-interpolated").acts(batch)
    decide = MotionDecider(actor, CELL).decide
    for e in np.flatnonzero(batch.state.outcome == 0):
        decision = decide(replace(query_of(batch, e), person_weighting="distance-weighted"))
        np.testing.assert_allclose(decision.act, expected[e], atol=2e-6)
        assert sum(one.weight for one in decision.person_weights) == pytest.approx(1.0)


def test_weights_of_targets_sum_to_one_and_give_the_goal_back() -> None:
    for goals, most in (("grid", 8), ("halton", 4)):
        decision = decider(goals).decide(query())
        weights = np.array([one.weight for one in decision.targets])
        places = np.array([one.position for one in decision.targets])
        assert decision.inference_mode == "interpolated" and 1 < len(weights) <= most
        assert weights.sum() == pytest.approx(1.0)
        np.testing.assert_allclose(weights @ places, GOAL, atol=1e-12)


@pytest.mark.parametrize("goals", ["grid", "halton"])
def test_at_a_training_target_both_modes_agree(goals: str) -> None:
    one, region = decider(goals), CELL.goal_region
    targets = region.targets() if goals == "grid" else halton_targets(region)
    for target in targets[::7]:
        found = [
            one.decide(query(goal=target, inference_mode=mode))
            for mode in ("interpolated", "direct")
        ]
        np.testing.assert_array_equal(found[0].act, found[1].act)
        assert [target.weight for target in found[0].targets] == [1.0]


def test_interpolation_refuses_goals_outside_and_direct_flags_them() -> None:
    trained = {"goal": {"low": [-0.5, 0.6, 0.1], "high": [0.5, 1.0, 0.5]}}
    far = query(goal=np.array([0.0, 1.6, 0.3]))
    with pytest.raises(GoalOutside) as caught:
        decider(trained_range=trained).decide(far)
    (axis,) = caught.value.problem()["outside"]
    assert (axis["axis"], axis["by_m"]) == ("y", pytest.approx(0.6))
    for goals, mode in (("grid", "direct"), ("box", None)):
        decision = decider(goals, trained_range=trained).decide(
            replace(far, inference_mode=mode)
        )
        assert [one.field for one in decision.outside] == ["goal.y"]
        assert decision.inference_mode == "direct"
        assert decision.beyond_reach == pytest.approx(0.1720, abs=1e-4)
    assert decider().decide(query()).beyond_reach == 0.0


def test_states_and_people_outside_training_are_flagged_by_name() -> None:
    trained = {
        "q": {"low": [-3.0] * 6, "high": [3.0, 3.0, 1.5, 3.0, 3.0, 3.0]},
        "human": {"low": [-2.0, 0.5, -1.0, -1.0, 0.2], "high": [1.0, 2.0, 1.0, 1.0, 0.5]},
    }
    people = (FAR_PERSON, person_from_cylinder(0.4, 1.2, 0.0, 1.8, 0.3))
    decision = decider(trained_range=trained).decide(query(people=people))
    assert decision.nearest_person == 1
    assert [one.field for one in decision.outside] == ["robot.q.elbow", "people[1].vy"]
    alone = decider(trained_range=trained).decide(query(people=()))
    assert [one.field for one in alone.outside] == ["robot.q.elbow"]


def inside_robot() -> Person:
    return person_from_cylinder(0.2, 0.2, 0.0, 0.0, 0.5)


def test_people_inside_the_robot_are_refused_without_monitoring() -> None:
    with pytest.raises(InvalidInput, match=r"people\[1\] = -.* inside"):
        decider().decide(query(people=(FAR_PERSON, inside_robot())))


@pytest.mark.parametrize("speed", [0.0, 0.6])
def test_with_monitoring_a_person_inside_the_robot_is_a_stop(speed: float) -> None:
    qd, people = np.full(6, speed), (FAR_PERSON, inside_robot())
    asked = query(qd=qd, people=people, safety=SafetySettings())
    decision = decider().decide(asked)
    assert decision.safe is not None and decision.safe.override == 0.0
    assert decision.terms_of == 1 and decision.person_weights[1].separation < 0.0
    arm = decider().arm
    np.testing.assert_allclose(
        np.abs(decision.safe.qd),
        np.maximum(0.0, speed - arm.limits.qdd_max * arm.dt),
        atol=1e-9,
    )


def test_monitoring_tells_the_terms_that_make_up_the_distance() -> None:
    settings = SafetySettings(human_speed=1.2, intrusion_distance=0.05, robot_uncertainty=0.02)
    person = person_from_cylinder(0.3, 1.3, 0.0, -0.5, 0.3)
    asked = query(qd=np.full(6, 0.5), people=(person,), safety=settings, age_s=0.04)
    decision = decider().decide(asked)
    terms = decision.terms
    assert decision.safe is not None and terms is not None and decision.terms_of == 0
    assert decision.safe.override < 1.0 and decision.safe.person == 0
    assert terms.reaction_time == pytest.approx(0.02 + 0.1 + 0.04)
    assert terms.stop_time == pytest.approx(0.1)
    mode = 1.2 * (terms.reaction_time + 0.1) + terms.robot_speed * terms.reaction_time
    mode += terms.robot_speed * 0.1 / 2 + 0.05 + 0.02 + 0.3
    assert terms.required == pytest.approx(mode) == decision.safe.required
    assert terms.separation == pytest.approx(decision.person_weights[0].separation, abs=1e-9)


@pytest.mark.parametrize(("measured", "speed"), [(True, 0.1), (False, 1.6)])
def test_only_a_measured_velocity_takes_the_place_of_the_assumed_one(
    measured: bool, speed: float
) -> None:
    person = person_from_cylinder(0.3, 1.3, 0.0, 0.0, 0.3, measured=measured)
    asked = query(people=(person,), safety=SafetySettings(use_measured_velocity=True))
    terms = decider().decide(asked).terms
    assert terms is not None and terms.human_speed == pytest.approx(speed)


def test_far_from_people_monitoring_leaves_the_piece_as_it_is() -> None:
    decision = decider().decide(query(safety=SafetySettings()))
    assert decision.safe is not None and decision.safe.override == 1.0
    np.testing.assert_array_equal(decision.safe.q, decision.segment.q)
    assert decision.terms is not None and decision.terms_of == 0
    assert decision.terms.separation > decision.terms.required
    no_people = decider().decide(query(people=(), safety=SafetySettings()))
    assert no_people.terms is None and no_people.nearest_person is None


def test_a_policy_that_limits_jerk_needs_accelerations() -> None:
    one = decider(action=ActionSettings(degree=3))
    with pytest.raises(InvalidInput, match=r"robot\.qdd"):
        one.decide(query())
    qdd = np.full(6, 0.4)
    decision = one.decide(query(qdd=qdd))
    np.testing.assert_array_equal(decision.segment.c, 0.5 * qdd)
    assert decision.segment.d.any()


BAD: list[tuple[dict[str, Any], str]] = [
    ({"q": HOME + 9.0}, r"robot\.q\[0\] = 9.0 must lie in \[-3\.1, 3\.1\]"),
    ({"q": np.full(6, np.nan)}, r"robot\.q\[0\].* finite"),
    ({"q": HOME[:5]}, r"robot\.q.* 6 numbers"),
    ({"qd": np.full(6, 1.1)}, r"robot\.qd\[0\]"),
    ({"qd": np.array([0, 0, 0, 0, 0, -np.inf])}, r"robot\.qd\[5\].* finite"),
    ({"qdd": np.full(6, 1e7)}, r"robot\.qdd\[0\]"),
    ({"qdd": np.full(6, np.nan)}, r"robot\.qdd\[0\].* finite"),
    ({"goal": np.array([0.0, np.nan, 0.3])}, r"goal\[1\].* finite"),
    ({"goal": np.array([0.0, 11.0, 0.3])}, r"goal\[1\]"),
    ({"time_left_s": float("-inf")}, "time_left_s"),
    ({"time_left_s": float("nan")}, "time_left_s"),
    ({"elapsed_s": -1.0}, "elapsed_s"),
    ({"elapsed_s": float("nan")}, "elapsed_s"),
    ({"age_s": float("inf")}, "age_s"),
    ({"inference_mode": "around"}, "choices: interpolated, direct"),
    ({"person_weighting": "farthest"}, "choices: nearest, distance-weighted"),
    ({"people": (FAR_PERSON,) * 5}, "at most 4"),
    ({"people": (Person(q=np.full(18, np.nan), qd=np.zeros(18)),)}, r"people\[0\]\.q\[0\]"),
    ({"people": (person_from_cylinder(0.0, 1.0, 99.0, 0.0, 0.3),)}, r"people\[0\]\.qd\[0\]"),
]


@pytest.mark.parametrize(("changes", "match"), BAD)
def test_what_cannot_be_answered_is_refused_by_name(
    changes: dict[str, Any], match: str
) -> None:
    with pytest.raises(InvalidInput, match=match):
        decider().decide(query(**changes))


def test_a_policy_of_a_box_cannot_be_asked_to_interpolate() -> None:
    with pytest.raises(InvalidInput, match="training targets"):
        decider("box").decide(query(inference_mode="interpolated"))


def test_a_policy_that_cannot_look_ahead_says_so() -> None:
    with pytest.raises(InvalidInput, match="option features") as refused:
        decider().decide(query(rollout=True))
    assert refused.value.field == "rollout"
    assert decider().decide(query()).rollout is False


def test_rollouts_answer_any_valid_query() -> None:
    rng = np.random.default_rng(6)
    one = MotionDecider(ReachPolicy(pretrained.load("reach")), CELL)
    began = 0
    for _ in range(100):
        asked = random_query(rng)
        decision = one.decide(asked)
        assert decision.rollout and keeps_limits(decision, asked)
        began += decision.candidate is not None
    assert 0 < began < 100


def test_an_answer_does_not_hang_on_what_was_asked_before() -> None:
    batch, actor = driven(12, ("walker",)), ReachPolicy(pretrained.load("reach"))
    rng = np.random.default_rng(6)
    questions = [random_query(rng) for _ in range(40)]
    questions += [
        with_history(batch, e) for e in np.flatnonzero(batch.state.outcome == 0).tolist()
    ]
    one = MotionDecider(actor, CELL)
    for k, asked in enumerate(questions):
        late = replace(asked, elapsed_s=0.7 * (k % 3))
        first = MotionDecider(actor, CELL).decide(late)
        assert np.array_equal(one.decide(late).act, first.act)


@pytest.mark.parametrize(
    "cause", [{"elapsed_s": 2.0}, {"time_left_s": 3.0}, {"safety": MEASURED_VELOCITY}]
)
def test_search_simulates_candidates_also_where_the_policy_does_not_collide(
    cause: dict[str, Any],
) -> None:
    rng, counts = np.random.default_rng(6), np.zeros(3, dtype=int)
    one = MotionDecider(ReachPolicy(pretrained.load("reach")), CELL)
    for _ in range(60):
        asked = random_query(rng)
        hurried = replace(asked, **cause)
        queries = asked, hurried, replace(hurried, search=False)
        counts += [one.decide(each).candidate is not None for each in queries]
    collides, searched, without = counts.tolist()
    assert 0 < without == pytest.approx(collides, abs=1) and without + 1 < searched


def test_the_observed_remaining_time_is_at_most_that_of_training() -> None:
    one = MotionDecider(ReachPolicy(pretrained.load("reach")), CELL)
    acts = [one.decide(query(time_left_s=left)).act for left in (2.0, 5.0, 25.0)]
    assert np.array_equal(acts[1], acts[2])
    assert not np.array_equal(acts[0], acts[1])


def test_a_policy_of_another_cell_is_refused() -> None:
    with pytest.raises(CheckpointMismatch):
        MotionDecider(RandomActor(), load_cell("pick-and-place"))


def random_query(rng: np.random.Generator) -> MotionQuery:
    """Anything that the border lets through, plausible or not."""
    mount, people = CELL.robot, []
    for _ in range(rng.integers(0, 5)):
        x, y = rng.uniform(-2.0, 2.0, 2)
        if rng.uniform() < 0.6:
            people.append(
                person_from_cylinder(x, y, *rng.uniform(-3, 3, 2), rng.uniform(0.01, 1.0))
            )
        else:
            q = rng.uniform(human.Q_MIN, human.Q_MAX)
            people.append(Person(q=q, qd=rng.normal(0.0, 1.0, 18)))
    return MotionQuery(
        q=rng.uniform(mount.q_min, mount.q_max),
        qd=rng.uniform(-1, 1, 6) * mount.qd_max,
        goal=rng.uniform([-0.5, 0.6, 0.1], [0.5, 1.0, 0.5]),
        people=people,
        person_weighting="distance-weighted" if rng.uniform() < 0.5 else "nearest",
        safety=SafetySettings(),
    )


def keeps_limits(decision: MotionDecision, asked: MotionQuery) -> bool:
    safe, mount = decision.safe, CELL.robot
    assert safe is not None
    numbers = np.concatenate([safe.q, safe.qd, safe.qdd, decision.act, [safe.override]])
    change = np.abs(safe.qd - asked.qd) / mount.dt
    return bool(
        np.isfinite(numbers).all()
        and 0.0 <= safe.override <= 1.0
        and (np.abs(safe.qd) <= np.array(mount.qd_max) + 1e-9).all()
        and (change <= np.array(mount.qdd_max) + 1e-6).all()
    )


def test_any_valid_state_gives_a_finite_answer_within_limits() -> None:
    rng, one = np.random.default_rng(4), decider()
    stopped = 0
    for _ in range(150):
        asked = random_query(rng)
        decision = one.decide(asked)
        assert keeps_limits(decision, asked)
        if decision.clearance[0] <= 0.0:
            assert decision.safe is not None and decision.safe.override == 0.0
            stopped += 1
    assert stopped > 10
