"""Robot states and people at the border: over limits, by name, far away, and absurd."""

from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.api.schemas.robot_state import ROS_NAMES
from app.sim.cells.cell import load_cell
from app.sim.human import model as human
from tests.api.answers import content_of, problem_of
from tests.api.conftest import ADDRESS

SOCKET = ADDRESS.replace("http", "ws") + "/v1/motion/stream"
REACH, PICK = load_cell("shared-workspace"), load_cell("pick-and-place")
WALKER = {"x": 0.3, "y": 1.6, "vx": 0, "vy": -0.5, "r": 0.3}
STANDING = {"q": human.rest_posture(0.0, 1.45, -1.57).tolist(), "qd": [0.0] * 18}
TASKS: dict[str, dict[str, Any]] = {
    "/v1/motion": {
        "cell": REACH.name,
        "robot": {"q": [0, -2.5, 2.0, 0, 0, 0], "qd": [0.0] * 6},
        "people": [WALKER],
        "goal": [0.05, 0.75, 0.31],
    },
    "/v1/task-selection": {
        "cell": PICK.name,
        "robot": {"q": [0.99, -2.33, 2.08, -1.32, -1.57, 0], "qd": [0.0] * 6},
        "people": [STANDING],
        "candidates": [{"id": "left", "position": [-0.5, 0.7, 0.12]}],
    },
}
FAST = {"/v1/motion": 1.0, "/v1/task-selection": 0.5}


@pytest.fixture(params=list(TASKS))
def url(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def asked(client: TestClient, url: str, **changes: Any) -> dict[str, Any]:
    found = content_of(client.post(url, json={**TASKS[url], **changes}))
    found.pop("elapsed_ms")
    return found


def refused(client: TestClient, url: str, **changes: Any) -> dict[str, Any]:
    return problem_of(client.post(url, json={**TASKS[url], **changes}))


def robot(url: str, **changes: Any) -> dict[str, Any]:
    return {**TASKS[url]["robot"], **changes}


def beyond_limits(answer: dict[str, Any]) -> list[dict[str, Any]]:
    return [one for one in answer["state_outside"] if one["of"] == "limits"]


@pytest.mark.parametrize("share", [1.0006, 1.001, 1.04])
def test_a_speed_a_hair_over_its_limit_is_answered_and_flagged(
    client: TestClient, url: str, share: float
) -> None:
    limit = FAST[url]
    answer = asked(client, url, robot=robot(url, qd=[share * limit, 0, 0, 0, 0, 0]))
    assert beyond_limits(answer) == [
        {
            "field": "robot.qd.shoulder_pan",
            "value": share * limit,
            "low": -limit,
            "high": limit,
            "of": "limits",
        }
    ]


@pytest.mark.parametrize("over", [1e-4, 0.03])
def test_all_joints_over_their_limits_are_answered(
    client: TestClient, url: str, over: float
) -> None:
    mount = REACH.robot if url == "/v1/motion" else PICK.robot
    q, qd = [x + over for x in mount.q_max], [1.03 * x for x in mount.qd_max]
    answer = asked(client, url, robot=robot(url, q=q, qd=qd))
    assert len(beyond_limits(answer)) == 12
    if url == "/v1/motion":
        assert answer["unfeasible"]
        starts = [row[:2] for row in answer["segment"]["coefficients"]]
        assert starts == [list(pair) for pair in zip(q, qd, strict=True)]
        assert all(now > then for now, then in zip(qd, answer["segment"]["qd"], strict=True))


def test_the_socket_answers_them_as_the_route_does(client: TestClient) -> None:
    url = "/v1/motion"
    body = {**TASKS[url], "robot": robot(url, qd=[1.001, 0, 0, 0, 0, 0]), "rollout": False}
    with client.websocket_connect(SOCKET) as socket:
        socket.send_json(body)
        answer = socket.receive_json()
    answer.pop("elapsed_ms")
    assert answer.pop("stream")["superseded"] == 0
    expected = asked(client, url, robot=body["robot"], rollout=False)
    assert answer == {name: value for name, value in expected.items() if name != "stream"}


def test_a_state_in_degrees_or_a_turn_away_is_refused_with_a_hint(
    client: TestClient, url: str
) -> None:
    q = TASKS[url]["robot"]["q"]
    in_degrees = [57.2958 * x for x in q]
    assert "degrees?" in refused(client, url, robot=robot(url, q=in_degrees))["rule"]
    turned = [q[0] + 6.2832, *q[1:]]
    problem = refused(client, url, robot=robot(url, q=turned))
    assert problem["field"] == "robot.q[0]" and "a whole turn away?" in problem["rule"]


def test_joints_are_taken_by_name_in_any_order(client: TestClient, url: str) -> None:
    qd = [0.1, -0.2, 0.3, 0.0, 0.05, -0.1]
    plain = asked(client, url, robot=robot(url, qd=qd))
    names = sorted(ROS_NAMES)
    order = [ROS_NAMES.index(name) for name in names]
    q = TASKS[url]["robot"]["q"]
    named = {"names": names, "q": [q[j] for j in order], "qd": [qd[j] for j in order]}
    assert names[0] == "elbow_joint"
    assert asked(client, url, robot=named) == plain
    wrong = asked(client, url, robot={"q": named["q"], "qd": named["qd"]})
    assert wrong != plain


@pytest.mark.parametrize(("left", "same"), [(-0.01, 0.0), (-300.0, 0.0), (1e6, 60.0)])
def test_a_deadline_that_has_passed_or_is_far_costs_no_decision(
    client: TestClient, url: str, left: float, same: float
) -> None:
    assert asked(client, url, time_left_s=left) == asked(client, url, time_left_s=same)


def test_the_frame_goes_by_the_name_of_ros_too(client: TestClient, url: str) -> None:
    assert asked(client, url, frame="base_link") == asked(client, url)
    assert refused(client, url, frame="base")["choices"] == ["robot-base", "base_link"]


def test_answers_name_the_joints_of_their_vectors(client: TestClient) -> None:
    assert asked(client, "/v1/motion")["joints"] == list(ROS_NAMES)


@pytest.mark.parametrize(
    ("names", "text"),
    [
        ([*ROS_NAMES[:5], "gripper_joint"], "'gripper_joint', lacks 'wrist_3_joint'"),
        ([*ROS_NAMES, "finger_joint"], "has the unknown name 'finger_joint'"),
        ([*ROS_NAMES[:5], "elbow_joint"], "holds 'elbow_joint' 2 times, lacks 'wrist_3_joint'"),
        (list(ROS_NAMES[:5]), "lacks 'wrist_3_joint'"),
        ([], "lacks 'shoulder_pan_joint'"),
    ],
)
def test_names_that_are_not_the_robots_are_refused_with_the_choices(
    client: TestClient, url: str, names: list[str], text: str
) -> None:
    problem = refused(client, url, robot=robot(url, names=names))
    assert problem["field"] == "robot.names" and text in problem["rule"]
    assert problem["choices"] == list(ROS_NAMES)


def test_errors_of_named_joints_are_at_their_place_in_the_request(
    client: TestClient, url: str
) -> None:
    names = sorted(ROS_NAMES)
    q = [TASKS[url]["robot"]["q"][ROS_NAMES.index(name)] for name in names]
    q[0] = 4.5  # the elbow
    problem = refused(client, url, robot=robot(url, names=names, q=q))
    assert problem["field"] == "robot.q[0]" and problem["rule"].endswith(": elbow_joint")


def test_joints_outside_the_training_range_have_their_name_in_any_order(
    client: TestClient, url: str
) -> None:
    q, names = [0.0, -2.5, -2.0, 3.0, 0.0, 0.0], sorted(ROS_NAMES)
    named = robot(url, names=names, q=[q[ROS_NAMES.index(name)] for name in names])
    for state in (robot(url, q=q), named):
        answer = asked(client, url, robot=state)
        found = {one["field"]: one["value"] for one in answer["state_outside"]}
        found |= {one["field"]: one["value"] for one in answer.get("outside", [])}
        assert found["robot.q.elbow"] == -2.0


FAR_PEOPLE: list[dict[str, Any]] = [
    {**WALKER, "x": 6.0},
    {**WALKER, "x": -80.0, "y": 99.0},
    {**STANDING, "q": [7.0, -12.0, *STANDING["q"][2:]]},
]


@pytest.mark.parametrize("far", FAR_PEOPLE)
def test_far_people_cost_no_decision_and_are_flagged(
    client: TestClient, url: str, far: dict[str, Any]
) -> None:
    alone, both = asked(client, url), asked(client, url, people=[*TASKS[url]["people"], far])
    assert [one["flags"] for one in both["people"]] == [[], ["far"]]
    assert [one["used"] for one in both["people"]] == [True, False]
    only = asked(client, url, people=[far])
    assert only["people"][0]["flags"] == ["far"]
    if url == "/v1/motion":
        assert both["people"][1]["separation"] > 4.0
        assert both["safety"] == alone["safety"]
        named = {one["field"]: one["value"] for one in only["outside"]}
        x = far.get("x", far.get("q", [0])[0])
        assert named["people[0].x"] == pytest.approx(x, abs=0.5)
    else:
        assert both["candidates"] == alone["candidates"]


def test_key_points_of_a_distant_person_keep_their_position(client: TestClient) -> None:
    points: list[Any] = [None] * 25
    for k, (x, y, z) in {
        0: (0.0, 1.33, 0.81),
        1: (0.0, 1.45, 0.64),
        2: (-0.18, 1.45, 0.64),
        5: (0.18, 1.45, 0.64),
        8: (0.0, 1.45, 0.20),
        9: (-0.09, 1.45, 0.20),
        12: (0.09, 1.45, 0.20),
    }.items():
        points[k] = [x + 40.0, y, z]
    answer = asked(client, "/v1/motion", people=[{"keypoints": points}])
    assert answer["people"][0]["flags"] == ["far"]
    assert answer["people"][0]["separation"] > 37.0


@pytest.mark.parametrize(
    ("change", "flags"),
    [
        ({"r": 40.0}, ["clamped"]),
        ({"growth": 9.0}, ["clamped"]),
        ({"past": [[0.3, 11.0]]}, ["clamped"]),
        ({"x": 7.0, "r": 6.0}, ["far", "clamped"]),
        ({"vx": 12.0}, []),
    ],
)
def test_what_a_tracked_cylinder_can_be_is_answered(
    client: TestClient, url: str, change: dict[str, Any], flags: list[str]
) -> None:
    answer = asked(client, url, people=[{**WALKER, **change}])
    assert answer["people"][0]["flags"] == flags


@pytest.mark.parametrize(
    ("joint", "value", "flags"),
    [(13, -0.2, ["clamped"]), (3, 1.6, ["clamped"]), (2, 25.0, []), (2, -9.0, [])],
)
def test_joints_of_a_person_somewhat_beyond_the_model_are_answered(
    client: TestClient, url: str, joint: int, value: float, flags: list[str]
) -> None:
    q = [*STANDING["q"]]
    q[joint] = value
    answer = asked(client, url, people=[{**STANDING, "q": q}])
    assert answer["people"][0]["flags"] == flags


def test_full_turns_of_a_person_have_no_effect(client: TestClient) -> None:
    q = [*STANDING["q"]]
    q[2] += 10 * 3.141592653589793
    turned = asked(client, "/v1/task-selection", people=[{**STANDING, "q": q}])
    still = asked(client, "/v1/task-selection")
    for one, other in zip(turned["candidates"], still["candidates"], strict=True):
        assert one["value"] == pytest.approx(other["value"], abs=1e-4)


@pytest.mark.parametrize(
    ("person", "field"),
    [
        ({**WALKER, "x": 600.0}, "people[0].x"),
        ({**WALKER, "y": -1600.0}, "people[0].y"),
        ({**WALKER, "r": 300.0}, "people[0].r"),
        ({**WALKER, "vx": 500.0}, "people[0].vx"),
        ({**WALKER, "growth": -60.0}, "people[0].growth"),
        ({**STANDING, "q": [1200.0, *STANDING["q"][1:]]}, "people[0].q[0]"),
        (
            {**STANDING, "q": [*STANDING["q"][:13], 40.0, *STANDING["q"][14:]]},
            "people[0].q[13]",
        ),
        ({**STANDING, "qd": [80.0, *STANDING["qd"][1:]]}, "people[0].qd[0]"),
    ],
)
def test_what_no_person_can_be_is_refused_by_field_and_rule(
    client: TestClient, url: str, person: dict[str, Any], field: str
) -> None:
    problem = refused(client, url, people=[person])
    assert problem["field"] == field and problem["rule"]


def test_the_state_of_a_world_can_be_posted_back_by_name(client: TestClient) -> None:
    state = client.get("/v1/worlds/main").json()["state"]
    state["robot"]["names"] = list(ROS_NAMES)
    assert client.post("/v1/task-selection", json=state).status_code == 200
