"""People in a request, by whatever is known of them; nothing is taken silently."""

import json
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from app.sim.perception.keypoints import BODY_25, K
from tests.api.answers import content_of, post_json
from tests.api.routes.test_task_selection import URL, refused
from tests.sim.postures import FRAMES
from tests.sim.tracked_person import CELL, seen, work

Q = work(1, 12.0)[1][100]
POINTS: list[Any] = seen(Q).round(6).tolist()
WHOLE = {"q": Q.tolist(), "qd": [0.0] * 18}
MOTION: dict[str, Any] = {
    "cell": "shared-workspace",
    "robot": {"q": [0, -2.5, 2.0, 0, 0, 0], "qd": [0.4, 0, 0, 0, 0, 0]},
    "goal": [0.05, 0.75, 0.31],
}


def without(*names: str) -> list[Any]:
    return [
        None if k in [K[name] for name in names] else point for k, point in enumerate(POINTS)
    ]


def asked(client: TestClient, state: dict[str, Any], *people: Any) -> dict[str, Any]:
    return content_of(client.post(URL, json={**state, "people": list(people)}))


def values(answer: dict[str, Any]) -> list[float]:
    return [one["value"] for one in answer["candidates"]]


def test_keypoints_of_a_posture_are_worth_what_the_posture_is(
    client: TestClient, state: dict[str, Any]
) -> None:
    by_joints = asked(client, state, WHOLE)
    by_points = asked(client, state, {"keypoints": POINTS})
    assert by_joints["people"][0]["by"] == "joint-angles"
    use = by_points["people"][0]
    assert (use["by"], use["used"], use["speeds"]) == ("keypoints", True, "zero")
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
    assert [one["used"] for one in answer["people"]] == [False, False, True, False]
    assert values(answer) == values(alone)


def test_request_without_people_is_answered(client: TestClient, state: dict[str, Any]) -> None:
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


def asked_in_text(client: TestClient, state: dict[str, Any], points: str) -> dict[str, Any]:
    """Post key-points as other tools write them, with tokens that strict JSON lacks."""
    body = json.dumps({**state, "people": [{"keypoints": "POINTS"}]})
    return content_of(post_json(client, URL, body.replace('"POINTS"', points)))


@pytest.mark.parametrize(
    "missing",
    ["null", "[]", "[null, null, null]", "[null, null, null, 0]", "[NaN, NaN, NaN]"]
    + ["[NaN, NaN, NaN, NaN]", "[0, 0, 0]", "[0.0, 0.0, 0.0, 0.0]", "[-1, -1, -1]"]
    + [
        "[-1, -1, -1, 0]",
        "[0.1, 0.2, 0.3, 0]",
        "[0.1, 0.2, 0.3, null]",
        '["NaN", "NaN", "NaN"]',
    ],
)
def test_a_missing_keypoint_is_missing_however_it_is_written(
    client: TestClient, state: dict[str, Any], missing: str
) -> None:
    points = [json.dumps(point) for point in POINTS]
    points[K["elbow_r"]] = points[K["wrist_r"]] = missing
    answer = asked_in_text(client, state, f"[{', '.join(points)}]")
    same = asked(client, state, {"keypoints": without("elbow_r", "wrist_r")})
    assert answer["people"] == same["people"]
    assert same["people"][0]["missing"] == ["elbow_r", "wrist_r"]
    assert same["people"][0]["flags"] == same["people"][0]["unusable"] == []


@pytest.mark.parametrize(
    "unusable",
    ["[0.1, null, 0.3]", "[NaN, 0.2, 0.3]", "[Infinity, 0, 0]", "[1e999, 1e999, 1e999]"]
    + ["[0.1, 0.2]", "[0.1]", "[0.1, 0.2, 0.3, 1, 5]", "[0.1, 0.2, 0.3, 2]"]
    + ["[0.1, 0.2, 0.3, -1]", "[-9999, -9999, -9999]"],
)
def test_a_keypoint_that_cannot_be_used_costs_that_one_and_is_named(
    client: TestClient, state: dict[str, Any], unusable: str
) -> None:
    points = [json.dumps(point) for point in POINTS]
    points[K["wrist_r"]] = unusable
    use = asked_in_text(client, state, f"[{', '.join(points)}]")["people"][0]
    assert use["unusable"] == use["missing"] == ["wrist_r"] and use["implausible"] is None


def test_the_socket_takes_keypoints_as_other_tools_write_them(client: TestClient) -> None:
    question = {**MOTION, "people": [{"keypoints": [*POINTS[:15], *["MISSING"] * 10]}]}
    with client.websocket_connect("ws://127.0.0.1/v1/motion/stream") as socket:
        for missing in ("null", "[NaN, NaN, NaN]", "[null, null, null, 0]", "[]"):
            socket.send_text(json.dumps(question).replace('"MISSING"', missing))
            (person,) = socket.receive_json()["people"]
            assert person["flags"] == person["unusable"] == [] and len(person["missing"]) == 10


def test_keypoints_by_name_are_those_in_order_and_absent_ones_are_missing(
    client: TestClient, state: dict[str, Any]
) -> None:
    points = without("wrist_r", "eye_l")
    named = {name: point for name, point in zip(BODY_25, points, strict=True) if point}
    pace = {"neck": [0.0, -0.5, 0.0], "mid_hip": [0.0, -0.5, 0.0]}
    paces = [pace.get(name) for name in BODY_25]
    one = asked(client, state, {"keypoints": named, "velocities": pace})
    two = asked(client, state, {"keypoints": points, "velocities": paces})
    assert one["people"] == two["people"] and values(one) == values(two)
    assert one["people"][0]["speeds"] == "given"


@pytest.mark.parametrize(
    ("velocity", "speeds", "named"),
    [
        ("null", "zero", False),
        ("[]", "zero", False),
        ("[NaN, NaN, NaN]", "zero", False),
        ("[null, null, null]", "zero", False),
        ("[0, 0, 0]", "given", False),
        ("[0, null, 0]", "given", True),
        ("[Infinity, 0, 0]", "given", True),
        ("[1e9, 0, 0]", "given", True),
        ("[0, 0]", "given", True),
    ],
)
def test_velocities_are_missing_or_unusable_as_keypoints_are(
    client: TestClient, state: dict[str, Any], velocity: str, speeds: str, named: bool
) -> None:
    person = f'{json.dumps(POINTS)}, "velocities": [{", ".join([velocity] * 25)}]'
    use = asked_in_text(client, state, person)["people"][0]
    assert use["speeds"] == speeds and ("velocity of neck" in use["unusable"]) is named


@pytest.mark.parametrize(
    ("points", "flag", "implausible"),
    [
        ((1000.0 * np.array(POINTS)).tolist(), "foreign-frame", "millimetres"),
        ((np.array(POINTS) + [0.0, 0.0, 2.0]).tolist(), "foreign-frame", "over the floor"),
        (
            (np.array(POINTS) @ FRAMES["a camera's, y down and z ahead"].T).tolist(),
            "foreign-frame",
            "a camera's frame?",
        ),
        ([None] * 25, "never-seen", None),
        ([[*point, 87.0] for point in POINTS], "never-seen", None),
        ([[320.0 + k, 240.0] for k in range(25)], "never-seen", None),
    ],
)
def test_person_of_unknown_position_is_answered_and_stops_the_robot(
    client: TestClient, state: dict[str, Any], points: Any, flag: str, implausible: str | None
) -> None:
    use = asked(client, state, WHOLE, {"keypoints": points})["people"][1]
    assert flag in use["flags"] and use["as_cylinder"] and use["age_s"] is None
    assert implausible is None or implausible in use["implausible"]
    assert "never-seen" in use["flags"]
    far = {"x": 4.0, "y": 3.0, "vx": 0, "vy": 0, "r": 0.3}
    without_them = client.post("/v1/motion", json={**MOTION, "people": [far]}).json()
    assert without_them["safety"]["override"] == 1.0
    people = [far, {"keypoints": points}]
    safety = content_of(client.post("/v1/motion", json={**MOTION, "people": people}))["safety"]
    assert safety["override"] < 1.0 and safety["set_by"] == 1


@pytest.mark.parametrize(
    ("person", "field", "rule"),
    [
        ({"keypoints": POINTS[:24]}, "people[0].keypoints", "at least 25"),
        ({"keypoints": {"nek": POINTS[1]}}, "people[0].keypoints", "nek"),
        ({"keypoints": [["a"] * 3, *POINTS[1:]]}, "people[0].keypoints[0][0]", "number"),
        ({"keypoints": ["a", *POINTS[1:]]}, "people[0].keypoints[0]", "list"),
        ({"keypoints": POINTS, "velocities": []}, "people[0].velocities", "at least 25"),
        ({"keypoints": POINTS, "q": WHOLE["q"]}, "people[0].qd", "is required"),
        ({"x": 0, "y": 1, "vx": 0, "vy": 0, "r": 0}, "people[0].r", "must be at least 0.01"),
        ({"x": 900, "y": 1, "vx": 0, "vy": 0, "r": 1}, "people[0].x", "must be at most"),
        ({"tracker": "none", "person": 0}, "people[0].tracker", "not an open tracker"),
        ({**WHOLE, "body": {"stature": 0}}, "people[0].body.stature", "must be at least"),
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


def test_of_more_than_four_people_the_nearest_count_and_the_rest_is_named(
    client: TestClient, state: dict[str, Any]
) -> None:
    crowd: list[Any] = [{"x": 0.5 * k, "y": 5.0, "vx": 0, "vy": 0, "r": 0.3} for k in range(7)]
    farther = {**WHOLE, "q": [0.0, 4.0, *WHOLE["q"][2:]]}
    people = [*crowd[:4], farther, *crowd[4:], WHOLE, {"keypoints": POINTS}]
    state = {**state, "robot": {"q": CELL.robot.home_q, "qd": [0.0] * 6}}
    answer = asked(client, state, *people)
    near = asked(client, state, crowd[0], farther, WHOLE, {"keypoints": POINTS})
    assert values(answer) == values(near)
    kept = [i for i, one in enumerate(answer["people"]) if "dropped" not in one["flags"]]
    assert kept == [0, 4, 8, 9]
    assert [i for i, one in enumerate(answer["people"]) if one["used"]] in ([8], [9])
    assert all(
        "people[8]" in o["field"] or "people[9]" in o["field"] or "robot" in o["field"]
        for o in answer["state_outside"]
    )


def test_people_are_identified_by_their_index_among_many(client: TestClient) -> None:
    near = {"x": 0.3, "y": 1.1, "vx": 0, "vy": -0.5, "r": 0.3}
    crowd = [{"x": 0.7 * k, "y": 6.0, "vx": 0, "vy": 0, "r": 0.3} for k in range(6)]
    alone = client.post("/v1/motion", json={**MOTION, "people": [near]}).json()
    answer = client.post("/v1/motion", json={**MOTION, "people": [*crowd, near]}).json()
    assert answer["safety"]["set_by"] == answer["safety"]["terms"]["person"] == 6
    assert answer["safety"]["override"] == alone["safety"]["override"]
    assert answer["people"][6]["used"] and answer["people"][6]["separation"] < 1.0
    dropped = [i for i, one in enumerate(answer["people"]) if "dropped" in one["flags"]]
    assert dropped == [3, 4, 5]
    assert all(answer["people"][i]["separation"] is None for i in dropped)


@pytest.mark.parametrize("turns", [-3, -1, 1, 2, 1000])
def test_a_person_turned_by_whole_turns_is_the_same(
    client: TestClient, state: dict[str, Any], turns: int
) -> None:
    for yaw in (-3.2, -1.7, 0.3, 1.5):
        q = [*WHOLE["q"][:2], yaw, *WHOLE["q"][3:]]
        turned = [*q[:2], yaw + 2.0 * np.pi * turns, *q[3:]]
        first, second = (asked(client, state, {**WHOLE, "q": one}) for one in (q, turned))
        np.testing.assert_allclose(values(first), values(second), atol=1e-5)
        assert first["chosen"] == second["chosen"]


APPROACHING = {"x": 1.2, "y": 1.2, "vx": -2.5, "vy": -2.5, "r": 0.3}
BEHIND = [{"x": -1.0 - 0.01 * k, "y": -0.6, "vx": 0, "vy": 0, "r": 0.3} for k in range(4)]


def test_safety_layer_monitors_people_beyond_those_of_the_policy(
    client: TestClient,
) -> None:
    question = MOTION | {
        "robot": {"q": [0, -2.5, 2.0, 0, 0, 0], "qd": [0.9, 0, 0, 0, 0, 0]},
        "rollout": False,
        "safety": {"use_measured_velocity": True},
    }
    people = [*BEHIND, APPROACHING]
    answer = client.post("/v1/motion", json={**question, "people": people}).json()
    alone = client.post("/v1/motion", json={**question, "people": [APPROACHING]}).json()
    assert "dropped" in answer["people"][4]["flags"]
    assert answer["safety"]["override"] == alone["safety"]["override"] < 1.0
    assert answer["safety"]["set_by"] == 4


def test_wrong_people_among_many_are_refused_by_their_places(
    client: TestClient, state: dict[str, Any]
) -> None:
    problem = refused(client, {**state, "people": [WHOLE] * 65})
    assert problem["field"] == "people" and "at most 64" in problem["rule"]
    wrong = {**WHOLE, "size": [0] * 12}
    problem = refused(client, {**state, "people": [*[WHOLE] * 5, wrong]})
    assert problem["field"] == "people[5].size[1]"
