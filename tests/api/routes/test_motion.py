"""``POST /v1/motion`` and its socket: answers, flags, stops, and what is refused."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from starlette.testclient import WebSocketTestSession
from starlette.websockets import WebSocketDisconnect

from app.policies.checkpoints.checkpoint import Checkpoint, pack
from app.sim.cells.cell import load_cell
from app.store.records import NewCheckpoint
from tests.api.conftest import ADDRESS
from tests.policies.untrained import untrained_reach

URL, STREAM = "/v1/motion", "/v1/motion/stream"
SOCKET = ADDRESS.replace("http", "ws") + STREAM
GRID, BOX, JERK = "untrained-grid", "untrained-box", "untrained-jerk"
PAGE = (Path(__file__).parents[3] / "docs" / "http.md").read_text("utf-8")
HOME = list(load_cell("shared-workspace").robot.home_q)
WALKER = {"x": 0.3, "y": 1.5, "vx": 0.0, "vy": -0.5, "r": 0.3}
FAR = {"x": -1.8, "y": 1.9, "vx": 0.0, "vy": 0.0, "r": 0.3}
INSIDE = {"x": 0.2, "y": 0.2, "vx": 0.0, "vy": 0.0, "r": 0.5}
STANDING = {
    "q": [0.6, 1.45, -1.57, 0, 0, 0, 0, 0, 0, 0, 0.15, 0.12, 0, 0.45, 0.15, 0.12, 0, 0.45],
    "qd": [0.0] * 18,
}
RANGES = {
    "goal": {"low": [-0.5, 0.6, 0.1], "high": [0.5, 1.0, 0.5]},
    "human": {"low": [-2.0, 0.5, -1.0, -1.0, 0.2], "high": [1.0, 2.0, 1.0, 1.0, 0.5]},
}
TASK: dict[str, Any] = {
    "cell": "shared-workspace",
    "robot": {"q": HOME, "qd": [0.0] * 6},
    "people": [WALKER],
    "goal": [0.05, 0.75, 0.31],
    "checkpoint": GRID,
}


def with_ranges(checkpoint: Checkpoint) -> Checkpoint:
    """The same, as if it had met certain values in training."""
    return pack({**checkpoint.manifest, "trained_range": RANGES}, checkpoint.arrays())


@pytest.fixture(scope="module", autouse=True)
def policies(client: TestClient) -> dict[str, str]:
    """Policies that have learned nothing, in the store of the service."""
    names = client.app.state.services.checkpoints  # type: ignore[attr-defined]
    made = {
        GRID: with_ranges(untrained_reach()),
        BOX: with_ranges(untrained_reach(goals="box")),
        JERK: untrained_reach(degree=3),
    }
    for alias, one in made.items():
        new = NewCheckpoint(sha256=one.sha256, manifest=one.manifest, tensors=one.tensors)
        names.publish(alias, new)
    return {alias: one.sha256 for alias, one in made.items()}


def asked(client: TestClient, **changes: Any) -> dict[str, Any]:
    answer = client.post(URL, json={**TASK, **changes})
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


def refused(client: TestClient, status: int = 422, **changes: Any) -> dict[str, Any]:
    content = json.dumps({**TASK, **changes})
    answer = client.post(URL, content=content, headers={"Content-Type": "application/json"})
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    problem: dict[str, Any] = answer.json()
    return problem


def at(piece: dict[str, Any], t: float) -> np.ndarray:
    """Joint positions of a piece at a time in its period."""
    t = min(t, piece["until"])
    return np.array([np.polynomial.polynomial.polyval(t, c) for c in piece["coefficients"]])


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
    assert person["by"] == "cylinder" and person["seen"] and person["weight"] == 1.0
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
    safety, piece = answer["safety"], answer["segment"]
    assert 0.0 <= safety["override"] < 1.0 and safety["set_by"] == 0
    np.testing.assert_allclose(at(piece, 0.02), piece["q"], atol=1e-12)
    slope = (at(piece, 0.02) - at(piece, 0.02 - 1e-7)) / 1e-7
    np.testing.assert_allclose(slope, piece["qd"], atol=1e-5)
    assert np.abs(piece["qd"]).max() < 0.9


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
    assert sum(one["seen"] for one in nearest["people"]) == 1
    weighted = asked(client, people=people, beside="distance-weighted", rollout=False)
    weights = [one["weight"] for one in weighted["people"]]
    assert sum(weights) == pytest.approx(1.0) and min(weights) > 0.0
    seen = [one["seen"] for one in weighted["people"]].index(True)
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
    assert answer["beyond_reach"] == pytest.approx(0.1593, abs=1e-4)


def test_people_outside_training_are_flagged(client: TestClient) -> None:
    answer = asked(client, people=[{**WALKER, "vy": -2.5}])
    assert [one["field"] for one in answer["outside"]] == ["people[0].vy"]
    assert asked(client, people=[])["outside"] == []


def test_a_policy_that_limits_jerk_asks_for_accelerations(client: TestClient) -> None:
    assert refused(client, checkpoint=JERK)["field"] == "robot.qdd"
    robot = {"q": HOME, "qd": [0.0] * 6, "qdd": [0.2] * 6}
    answer = asked(client, checkpoint=JERK, robot=robot, people=[])
    assert [len(one) for one in answer["segment"]["coefficients"]] == [4] * 6


BAD: list[tuple[dict[str, Any], int, str]] = [
    ({"cell": "moon"}, 422, "cell"),
    ({"cell": "pick-and-place"}, 409, "cell"),
    ({"checkpoint": "nobody"}, 422, "checkpoint"),
    ({"checkpoint": "pick"}, 409, "purpose"),
    ({"frame": "world"}, 422, "frame"),
    ({"robot": {"q": HOME[:5], "qd": [0.0] * 6}}, 422, "robot.q"),
    ({"robot": {"q": [9.0, *HOME[1:]], "qd": [0.0] * 6}}, 422, "robot.q[0]"),
    ({"robot": {"q": HOME, "qd": [0, 0, 1.2, 0, 0, 0]}}, 422, "robot.qd[2]"),
    ({"robot": {"q": HOME, "qd": [0, 0, float("nan"), 0, 0, 0]}}, 422, "robot.qd[2]"),
    (
        {
            "robot": {"q": HOME, "qd": [0.0] * 6, "qdd": [0, 50, 0, 0, 0, 0]},
            "checkpoint": JERK,
        },
        422,
        "robot.qdd[1]",
    ),
    ({"goal": [0.0, 0.8]}, 422, "goal"),
    ({"goal": [0.0, float("inf"), 0.3]}, 422, "goal[1]"),
    ({"goal": [0.0, 1e300, 0.3]}, 422, "goal[1]"),
    ({"goal": "there"}, 422, "goal"),
    ({"inference_mode": "around"}, 422, "inference_mode"),
    ({"inference_mode": "interpolated", "checkpoint": BOX}, 422, "inference_mode"),
    ({"beside": "farthest"}, 422, "beside"),
    ({"time_left_s": -1e12}, 422, "time_left_s"),
    ({"elapsed_s": -1}, 422, "elapsed_s"),
    ({"age_s": -1}, 422, "age_s"),
    ({"safety": {"human_speed": -1}}, 422, "safety.human_speed"),
    ({"safety": {"speed_change": -1}}, 422, "safety.speed_change"),
    ({"safety": {"human_sped": 1}}, 422, "safety.human_sped"),
    ({"safety": {"reaction_time": float("nan")}}, 422, "safety.reaction_time"),
    ({"people": [WALKER] * 65}, 422, "people"),
    ({"people": [{"x": 0.1}]}, 422, "people[0].y"),
    ({"people": [{**WALKER, "r": -1}]}, 422, "people[0].r"),
    ({"people": [{**WALKER, "vx": 1e9}]}, 422, "people[0].vx"),
    ({"people": [{"tracker": "none", "person": 0}]}, 422, "people[0].tracker"),
    ({"people": None}, 422, "people"),
    ({"previous": 1}, 422, "previous"),
]


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
        answer = client.post(
            URL, content=json.dumps(body), headers={"Content-Type": "application/json"}
        )
        statuses.append(answer.status_code)
        assert answer.status_code in (200, 422), answer.text
        if answer.status_code == 422:
            assert answer.json()["field"].startswith(("robot.q", "goal", "people[1].q"))
        else:
            assert np.isfinite(answer.json()["segment"]["q"]).all()
    assert {200, 422} == set(statuses)


@pytest.fixture
def socket(client: TestClient) -> Iterator[WebSocketTestSession]:
    with client.websocket_connect(SOCKET) as one:
        yield one


def without_time(answer: dict[str, Any]) -> dict[str, Any]:
    return {k: v for k, v in answer.items() if k not in ("elapsed_ms", "stream")}


def test_socket_gives_the_answers_of_the_route(
    client: TestClient, socket: WebSocketTestSession
) -> None:
    for k in range(5):
        changes = {"stamp": k, "goal": [0.1 * k, 0.7, 0.2]}
        socket.send_json({**TASK, **changes, "rollout": True})
        found = socket.receive_json()
        assert found["stream"]["superseded"] == 0 and found["stream"]["waited_ms"] >= 0.0
        expected = asked(client, **changes)
        assert without_time(found) == without_time(expected) and expected["stream"] is None


@pytest.mark.parametrize(
    ("message", "status"),
    [
        ("", 400),
        ("{", 400),
        ("[" * 50_000, 400),
        ("null", 422),
        ("[1, 2]", 422),
        ('{"cell": "shared-workspace"}', 422),
        (json.dumps({**TASK, "goal": [9.0, 0.8, 0.3], "stamp": 7}), 422),
        (json.dumps({**TASK, "goal": [float("nan"), 0.8, 0.3]}), 422),
        (json.dumps({**TASK, "stamp": float("nan")}), 422),
        (json.dumps({**TASK, "cell": "pick-and-place"}), 409),
        (json.dumps({**TASK, "cell": "x" * 70_000}), 413),
    ],
)
def test_a_bad_message_is_answered_by_a_problem_and_the_socket_lives_on(
    socket: WebSocketTestSession, message: str, status: int
) -> None:
    socket.send_text(message)
    problem = json.loads(socket.receive_text(), parse_constant=pytest.fail)
    assert problem["status"] == status and problem["detail"]
    assert problem["instance"] == STREAM
    assert problem.get("stamp") in (None, 7)
    socket.send_json({**TASK, "stamp": "next"})
    assert socket.receive_json()["stamp"] == "next"


def test_bytes_are_no_message(socket: WebSocketTestSession) -> None:
    socket.send_bytes(json.dumps(TASK).encode())
    assert socket.receive_json()["status"] == 400
    socket.send_json(TASK)
    assert socket.receive_json()["inference_mode"] == "interpolated"


def test_problems_on_the_socket_are_those_of_the_route(
    client: TestClient, socket: WebSocketTestSession
) -> None:
    for changes, status, _ in BAD:
        socket.send_text(json.dumps({**TASK, **changes}))
        found, expected = socket.receive_json(), refused(client, status, **changes)
        assert found.pop("stream")["left_out"] == []
        differ = {"instance": "", "request_id": ""}
        assert found | differ == expected | differ


def test_socket_refuses_pages_of_other_sites(client: TestClient) -> None:
    with (
        pytest.raises(WebSocketDisconnect) as caught,
        client.websocket_connect(SOCKET, headers={"Origin": "http://evil.example"}),
    ):
        pass
    assert caught.value.code == 1008


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"cell": "\ud800"}, "cell"),
        ({"cell": "a\0"}, "cell"),
        ({"t\0": 1}, "t\0"),
        ({"checkpoint": 2**70}, "checkpoint"),
        ({"people": [[[2**64]]]}, "people[0][0][0]"),
    ],
)
def test_a_socket_outlives_text_and_integers_that_nothing_takes(
    client: TestClient, change: dict[str, Any], field: str
) -> None:
    with client.websocket_connect(SOCKET) as one:
        one.send_text(json.dumps({**TASK, **change, "stamp": "s1"}))
        reply = one.receive_json()
        assert (reply["status"], reply["field"], reply["stamp"]) == (422, field, "s1")
        for text in ("[" * 60_000, '{"a": ' * 10_000, "[" * 100 + "]" * 100):
            one.send_text(text)
            assert one.receive_json()["status"] in (400, 422)
        one.send_json(TASK)
        assert one.receive_json()["inference_mode"] == "interpolated"


def test_a_stopping_server_ends_its_sockets(client: TestClient) -> None:
    stopping = client.app.state.services.stopping  # type: ignore[attr-defined]
    with client.websocket_connect(SOCKET) as one:
        one.send_json(TASK)
        assert one.receive_json()["inference_mode"] == "interpolated"
        stopping.set()
        try:
            assert one.receive()["code"] == 1001
        finally:
            stopping.clear()


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
