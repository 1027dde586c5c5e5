"""``POST /v1/motion``: answers, flags, stops, and what is refused."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from tests.api.answers import post_json
from tests.api.routes.motion.motion_requests import (
    BAD,
    BOX,
    FAR,
    GRID,
    HOME,
    INSIDE,
    JERK,
    STANDING,
    TASK,
    URL,
    WALKER,
    asked,
    refused,
)

pytestmark = pytest.mark.usefixtures("policies")
PAGE = (Path(__file__).parents[4] / "docs" / "http.md").read_text("utf-8")


def at(segment: dict[str, Any], t: float) -> np.ndarray:
    """Joint positions of a segment at a time in its period."""
    t = min(t, segment["until"])
    return np.array([np.polynomial.polynomial.polyval(t, c) for c in segment["coefficients"]])


def test_answer_is_a_piece_per_joint_and_what_explains_it(
    client: TestClient, policies: dict[str, str]
) -> None:
    answer = asked(client, stamp="t0")
    assert answer["checkpoint"] == policies[GRID] and answer["stamp"] == "t0"
    assert answer["inference_mode"] == "interpolated" and answer["dt"] == 0.02
    assert sum(one["weight"] for one in answer["targets"]) == pytest.approx(1.0)
    assert [len(one) for one in answer["commanded"]["coefficients"]] == [3] * 6
    np.testing.assert_allclose(at(answer["commanded"], 0.0), HOME)
    np.testing.assert_allclose(at(answer["commanded"], 0.02), answer["commanded"]["q"])
    (person,) = answer["people"]
    assert person["by"] == "cylinder" and person["used"] and person["weight"] == 1.0
    assert person["separation"] == pytest.approx(answer["clearance"]["people"])
    assert answer["distance"] > 0.3 and answer["beyond_reach"] == 0.0
    assert answer["outside"] == [] and not answer["unfeasible"]


def members(value: Any) -> Any:
    """The names in a JSON value, and of lists those in their first item."""
    if isinstance(value, dict):
        return {name: members(one) for name, one in value.items()}
    return [members(value[0])] if isinstance(value, list) and value else None


def test_the_page_shows_every_member_of_the_answer_to_its_example(client: TestClient) -> None:
    section = PAGE.split("## Motion\n")[1].split("\n## ")[0]
    (command,) = re.findall(r"```sh\n(.*?)```", section, re.DOTALL)
    (sample,) = re.findall(r"```json\n(.*?)```", section, re.DOTALL)
    body = json.loads(command.split("-d '")[1].rstrip().removesuffix("'"))
    answer, shown = asked(client, **body), json.loads(sample)
    assert members(answer) == members(shown)
    for name in ("segment", "targets", "safety", "people", "clearance", "distance"):
        assert rounded(answer[name]) == shown[name]


def rounded(value: Any) -> Any:
    """A JSON value with numbers as the page shows them."""
    if isinstance(value, dict):
        return {name: rounded(one) for name, one in value.items()}
    if isinstance(value, list):
        return [rounded(one) for one in value]
    return round(value, 4) if isinstance(value, float) else value


def test_without_anybody_the_whole_piece_is_executed(client: TestClient) -> None:
    answer = asked(client, people=[])
    assert answer["safety"]["override"] == 1.0 and answer["safety"]["terms"] is None
    assert answer["segment"] == answer["commanded"]
    assert answer["clearance"]["people"] == 1000.0


def test_executed_piece_is_a_polynomial_in_time_that_ends_where_it_says(
    client: TestClient,
) -> None:
    qd = [0.8, -0.4, 0.6, 0.1, 0.0, -0.9]
    answer = asked(client, robot={"q": HOME, "qd": qd}, people=[{**WALKER, "y": 1.3}])
    safety, segment = answer["safety"], answer["segment"]
    assert 0.0 <= safety["override"] < 1.0 and safety["set_by"] == 0
    np.testing.assert_allclose(at(segment, 0.02), segment["q"], atol=1e-12)
    slope = (at(segment, 0.02) - at(segment, 0.02 - 1e-7)) / 1e-7
    np.testing.assert_allclose(slope, segment["qd"], atol=1e-5)
    assert np.abs(segment["qd"]).max() < 0.9


def test_terms_add_up_to_the_distance_that_is_required(client: TestClient) -> None:
    safety = {"human_speed": 1.2, "intrusion_distance": 0.05, "person_uncertainty": 0.03}
    answer = asked(client, robot={"q": HOME, "qd": [0.5] * 6}, safety=safety, age_s=0.1)
    one = answer["safety"]["terms"]
    assert (one["human_speed"], one["intrusion"], one["person_uncertainty"]) == (
        1.2,
        0.05,
        0.03,
    )
    assert one["reaction_time"] == pytest.approx(0.02 + 0.1 + 0.1)
    distance = one["human_speed"] * (one["reaction_time"] + one["stop_time"])
    distance += one["robot_speed"] * one["reaction_time"] + one["braking"] + 0.05 + 0.03
    assert one["required"] == pytest.approx(distance + one["protective_distance"])


def test_who_is_seen_to_walk_past_does_not_hold_the_robot_where_velocities_are_measured(
    client: TestClient,
) -> None:
    def reply(vy: float, **safety: object) -> dict[str, Any]:
        walker = {**WALKER, "x": 0.0, "y": 1.12, "vx": 0.0, "vy": vy}
        answer = asked(client, people=[walker], safety=safety)
        found: dict[str, Any] = answer["safety"]
        return found

    assumed, measured = reply(0.0), reply(0.0, use_measured_velocity=True)
    assert assumed["override"] < measured["override"] == 1.0
    assert assumed["terms"]["human_speed"] == 1.6
    assert measured["terms"]["human_speed"] == pytest.approx(0.1)
    toward = reply(-1.0, use_measured_velocity=True, speed_change=0.3)
    assert toward["terms"]["human_speed"] == pytest.approx(1.3, abs=0.05)
    assert toward["override"] < 1.0


def test_a_person_observed_faster_than_assumed_counts_at_the_observed_speed(
    client: TestClient,
) -> None:
    """1.25 m away: a walker at 3 m/s, and a body that turns as fast, slow the robot."""
    place = {**WALKER, "x": 0.0, "y": 1.6, "vx": 0.0}
    walker = asked(client, people=[{**place, "vy": -3.0}])["safety"]["terms"]
    assert walker["human_speed"] == pytest.approx(3.0)
    assert (
        asked(client, people=[{**place, "vy": -1.5}])["safety"]["terms"]["human_speed"] == 1.6
    )
    body = {"q": [0.0, 1.6, -1.57] + [0.0] * 15, "qd": [0.0, -3.0] + [0.0] * 16}
    terms = asked(client, people=[body])["safety"]["terms"]
    assert terms["human_speed"] == pytest.approx(3.0)
    still = {**body, "qd": [0.0] * 18}
    assert asked(client, people=[still])["safety"]["terms"]["human_speed"] == 1.6


def test_overlapping_person_is_a_stop_with_monitoring_and_a_problem_without(
    client: TestClient,
) -> None:
    robot, people = {"q": HOME, "qd": [0.05] * 6}, [FAR, INSIDE]
    answer = asked(client, robot=robot, people=people)
    assert answer["safety"]["override"] == 0.0 and answer["safety"]["set_by"] == 1
    assert answer["people"][1]["separation"] < 0.0
    # 0.05 rad/s is gone after 0.01 s: the robot rests within the period.
    assert answer["segment"]["until"] == pytest.approx(0.01)
    assert answer["segment"]["qd"] == [0.0] * 6
    problem = refused(client, robot=robot, people=people, safety=None)
    assert problem["field"] == "people[1]" and "inside" in problem["rule"]


def test_several_people_of_any_kind_are_taken(client: TestClient) -> None:
    people = [FAR, STANDING, WALKER, {**FAR, "x": 0.9}]
    nearest = asked(client, people=people, rollout=False)
    assert sum(one["used"] for one in nearest["people"]) == 1
    weighted = asked(client, people=people, person_weighting="distance-weighted", rollout=False)
    weights = [one["weight"] for one in weighted["people"]]
    assert sum(weights) == pytest.approx(1.0) and min(weights) > 0.0
    seen = [one["used"] for one in weighted["people"]].index(True)
    assert weights[seen] == max(weights)
    assert weighted["act"] != nearest["act"]


def test_rollout_is_the_default_and_can_be_disabled(client: TestClient) -> None:
    there = asked(client)
    assert there["rollout"] is True
    alone = asked(client, rollout=False)
    assert alone["rollout"] is False and alone["alternative"] is None
    if there["alternative"] is None:
        assert there["act"] == pytest.approx(alone["act"], abs=1e-6)


def test_goals_outside_are_refused_by_interpolation_with_axis_and_distance(
    client: TestClient,
) -> None:
    problem = refused(client, goal=[0.62, 0.8, 0.05])
    assert problem["type"] == "urn:tandem:problem:invalid-input"
    assert problem["field"] == "goal"
    assert [(one["axis"], round(one["by_m"], 6)) for one in problem["outside"]] == [
        ("x", 0.12),
        ("z", 0.05),
    ]
    assert "0.12 m outside along x" in problem["detail"]


@pytest.mark.parametrize("changes", [{"inference_mode": "direct"}, {"checkpoint": BOX}])
def test_goals_outside_are_answered_directly_with_a_flag(
    client: TestClient, changes: dict[str, Any]
) -> None:
    answer = asked(client, goal=[0.0, 1.6, 0.3], **changes)
    assert answer["inference_mode"] == "direct" and answer["targets"] == []
    (flag,) = answer["outside"]
    assert (flag["field"], flag["value"], flag["high"]) == ("goal.y", 1.6, 1.0)
    assert answer["beyond_reach"] == pytest.approx(0.1720, abs=1e-4)


def test_people_outside_training_are_flagged(client: TestClient) -> None:
    answer = asked(client, people=[{**WALKER, "vy": -2.5}])
    assert [one["field"] for one in answer["outside"]] == ["people[0].vy"]
    assert asked(client, people=[])["outside"] == []


def test_a_policy_that_limits_jerk_asks_for_accelerations(client: TestClient) -> None:
    assert refused(client, checkpoint=JERK)["field"] == "robot.qdd"
    robot = {"q": HOME, "qd": [0.0] * 6, "qdd": [0.2] * 6}
    answer = asked(client, checkpoint=JERK, robot=robot, people=[])
    assert [len(one) for one in answer["segment"]["coefficients"]] == [4] * 6


@pytest.mark.parametrize(("changes", "status", "field"), BAD)
def test_bad_input_is_a_named_problem(
    client: TestClient, changes: dict[str, Any], status: int, field: str
) -> None:
    problem = refused(client, status, **changes)
    assert problem.get("field", "") == field and problem["detail"]


def test_whatever_numbers_come_the_answer_is_an_answer_or_a_named_problem(
    client: TestClient,
) -> None:
    rng = np.random.default_rng(6)
    strange = [
        0.0,
        -0.0,
        1e-320,
        1e308,
        -1e308,
        float("nan"),
        float("inf"),
        3.2,
        "1",
        None,
        True,
    ]
    statuses = []
    for _ in range(80):
        body = json.loads(json.dumps({**TASK, "people": [WALKER, STANDING]}))
        places = [
            (body["robot"]["q"], 6),
            (body["robot"]["qd"], 6),
            (body["goal"], 3),
            (body["people"][1]["q"], 18),
        ]
        for _ in range(rng.integers(1, 3)):
            where, n = places[rng.integers(len(places))]
            where[rng.integers(n)] = strange[rng.integers(len(strange))]
        answer = post_json(client, URL, body)
        statuses.append(answer.status_code)
        assert answer.status_code in (200, 422), answer.text
        if answer.status_code == 422:
            assert answer.json()["field"].startswith(("robot.q", "goal", "people[1].q"))
        else:
            assert np.isfinite(answer.json()["segment"]["q"]).all()
    assert {200, 422} == set(statuses)


def test_growth_of_a_cylinder_is_seen(client: TestClient) -> None:
    acts = [
        asked(client, people=[{**WALKER, "growth": growth}], rollout=False)["act"]
        for growth in (0.0, 0.3)
    ]
    assert acts[0] != acts[1]
    assert refused(client, people=[{**WALKER, "growth": 90}])["field"] == "people[0].growth"


def test_the_past_of_a_cylinder_is_seen_by_a_policy_that_forecasts(client: TestClient) -> None:
    grown = [[0.3 - 0.02 * k, 0.5] for k in range(1, 6)]
    acts = [
        asked(client, people=[{**WALKER, "past": past}], rollout=False)["act"]
        for past in ([], [[0.3, 0.5]] * 15, grown)
    ]
    assert acts[0] == acts[1] != acts[2]


@pytest.mark.parametrize(
    ("past", "field"),
    [
        ([[0.3, 0.5], [-0.1, 0.5]], "people[0].past[1][0]"),
        ([[0.3, 51.0]], "people[0].past[0][1]"),
        ([[0.3, "NaN"]], "people[0].past[0][1]"),
        ([[0.3]], "people[0].past[0][1]"),
        ([[0.3, 0.5]] * 16, "people[0].past"),
    ],
)
def test_a_past_that_cannot_be_is_refused(client: TestClient, past: Any, field: str) -> None:
    assert refused(client, people=[{**WALKER, "past": past}])["field"] == field
