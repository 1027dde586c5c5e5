"""People in a request, by whatever is known of them; nothing is taken silently."""

from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from app.sim.keypoints import K
from tests.api.test_task_selection import URL, refused
from tests.sim.tracked_person import CELL, seen, work

Q = work(1, 12.0)[1][100]
POINTS: list[Any] = seen(Q).round(6).tolist()
WHOLE = {"q": Q.tolist(), "qd": [0.0] * 18}


def without(*names: str) -> list[Any]:
    return [
        None if k in [K[name] for name in names] else point for k, point in enumerate(POINTS)
    ]


def asked(client: TestClient, state: dict[str, Any], *people: Any) -> dict[str, Any]:
    answer = client.post(URL, json={**state, "people": list(people)})
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


def values(answer: dict[str, Any]) -> list[float]:
    return [one["value"] for one in answer["candidates"]]


def test_keypoints_of_a_posture_are_worth_what_the_posture_is(
    client: TestClient, state: dict[str, Any]
) -> None:
    by_joints = asked(client, state, WHOLE)
    by_points = asked(client, state, {"keypoints": POINTS})
    assert by_joints["people"][0]["by"] == "joint-angles"
    use = by_points["people"][0]
    assert (use["by"], use["seen"], use["speeds"]) == ("keypoints", True, "zero")
    assert use["flags"] == use["held"] == use["missing"] == []
    assert values(by_points) == pytest.approx(values(by_joints), abs=0.05)


def test_missing_limbs_are_named_and_unsure_points_count_as_missing(
    client: TestClient, state: dict[str, Any]
) -> None:
    points = without("wrist_r")
    points[K["elbow_r"]] = [*POINTS[K["elbow_r"]], 0.01]
    use = asked(client, state, {"keypoints": points})["people"][0]
    assert use["missing"] == ["elbow_r", "wrist_r"]
    assert "elbow_r" in use["held"] and "elbow_l" not in use["held"]


def test_without_a_trunk_a_person_is_seen_as_a_cylinder_and_it_is_said(
    client: TestClient, state: dict[str, Any]
) -> None:
    points: list[Any] = [None] * 25
    points[K["wrist_l"]], points[K["elbow_l"]] = POINTS[K["wrist_l"]], POINTS[K["elbow_l"]]
    use = asked(client, state, {"keypoints": points})["people"][0]
    assert use["as_cylinder"] and use["age_s"] == 0.0


def test_a_cylinder_is_seen_as_a_person_who_stands_in_it(
    client: TestClient, state: dict[str, Any]
) -> None:
    cylinder = {"x": 0.0, "y": 1.3, "vx": 0.1, "vy": -0.2, "r": 0.35}
    answer = asked(client, state, cylinder)
    use = answer["people"][0]
    assert (use["by"], use["as_cylinder"], use["speeds"]) == ("cylinder", True, "given")


def test_of_four_people_the_nearest_is_seen(client: TestClient, state: dict[str, Any]) -> None:
    far = {"x": 4.0, "y": 4.0, "vx": 0.0, "vy": 0.0, "r": 0.3}
    farther = {**WHOLE, "q": [-4.0, 4.0, *WHOLE["q"][2:]]}
    alone = asked(client, state, WHOLE)
    answer = asked(client, state, far, farther, WHOLE, far)
    assert [one["seen"] for one in answer["people"]] == [False, False, True, False]
    assert values(answer) == values(alone)


def test_nobody_is_answered(client: TestClient, state: dict[str, Any]) -> None:
    assert asked(client, state)["people"] == []


def test_size_is_taken_by_percentiles_or_lengths_and_counts(
    client: TestClient, state: dict[str, Any]
) -> None:
    default = values(asked(client, state, WHOLE))
    median = values(asked(client, state, {**WHOLE, "size": CELL.body.tolist()}))
    same = values(asked(client, state, {**WHOLE, "body": {}}))
    tall = values(asked(client, state, {**WHOLE, "body": {"stature": 99, "arms": 99}}))
    assert default == median == pytest.approx(same)
    assert tall != default


def test_given_velocities_give_speeds(client: TestClient, state: dict[str, Any]) -> None:
    moving: list[Any] = [[0.0, -1.0, 0.0]] * 24 + [None]
    still = asked(client, state, {"keypoints": POINTS})
    answer = asked(client, state, {"keypoints": POINTS, "velocities": moving})
    assert answer["people"][0]["speeds"] == "given"
    assert values(answer) != values(still)


def millimetres() -> list[Any]:
    return (1000.0 * np.array(POINTS)).tolist()


@pytest.mark.parametrize(
    ("person", "field", "rule"),
    [
        ({"keypoints": [None] * 25}, "people[0].keypoints", "at least one"),
        ({"keypoints": POINTS[:24]}, "people[0].keypoints", "at least 25"),
        ({"keypoints": millimetres()}, "people[0].keypoints", "millimetres"),
        ({"keypoints": [[1.0, 2.0], *POINTS[1:]]}, "people[0].keypoints[0]", "at least 3"),
        (
            {"keypoints": [[0, 1, 1, 2.0], *POINTS[1:]]},
            "people[0].keypoints[0][3]",
            "confidence",
        ),
        ({"keypoints": POINTS, "velocities": []}, "people[0].velocities", "at least 25"),
        ({"keypoints": POINTS, "q": WHOLE["q"]}, "people[0].qd", "is required"),
        ({"x": 0, "y": 1, "vx": 0, "vy": 0, "r": 0}, "people[0].r", "must be greater"),
        ({"x": 900, "y": 1, "vx": 0, "vy": 0, "r": 1}, "people[0].x", "must be less"),
        ({"tracker": "none", "person": 0}, "people[0].tracker", "no open tracker"),
        ({**WHOLE, "body": {"stature": 0}}, "people[0].body.stature", "must be greater"),
        ({**WHOLE, "body": {}, "size": [1] * 12}, "people[0].size", "left out"),
        ({**WHOLE, "size": [0] * 12}, "people[0].size[1]", "must lie in"),
        ({"name": "Ada"}, "people[0]", "must be a person"),
        (7, "people[0]", "must be a person"),
    ],
)
def test_a_person_who_cannot_be_is_refused_by_place_and_rule(
    client: TestClient, state: dict[str, Any], person: Any, field: str, rule: str
) -> None:
    problem = refused(client, {**state, "people": [person]})
    assert problem["field"] == field
    assert rule in problem["rule"]


def test_a_field_that_no_such_person_has_is_refused_with_those_it_has(
    client: TestClient, state: dict[str, Any]
) -> None:
    problem = refused(client, {**state, "people": [{**WHOLE, "speed": 1.0}]})
    assert problem["field"] == "people[0].speed"
    assert problem["choices"] == ["q", "qd", "body", "size"]


def test_five_people_are_too_many(client: TestClient, state: dict[str, Any]) -> None:
    problem = refused(client, {**state, "people": [WHOLE] * 5})
    assert problem["field"] == "people" and "at most 4" in problem["rule"]
