"""Requests of ``POST /v1/motion`` and its socket, and what is refused."""

from typing import Any

from fastapi.testclient import TestClient

from app.sim.cells.cell import load_cell
from tests.api.answers import content_of, post_json, problem_of
from tests.api.conftest import ADDRESS

URL, STREAM = "/v1/motion", "/v1/motion/stream"
SOCKET = ADDRESS.replace("http", "ws") + STREAM
GRID, BOX, JERK = "untrained-grid", "untrained-box", "untrained-jerk"
HOME = list(load_cell("shared-workspace").robot.home_q)
WALKER = {"x": 0.3, "y": 1.5, "vx": 0.0, "vy": -0.5, "r": 0.3}
FAR = {"x": -1.8, "y": 1.9, "vx": 0.0, "vy": 0.0, "r": 0.3}
INSIDE = {"x": 0.2, "y": 0.2, "vx": 0.0, "vy": 0.0, "r": 0.5}
STANDING = {
    "q": [0.6, 1.45, -1.57, 0, 0, 0, 0, 0, 0, 0, 0.15, 0.12, 0, 0.45, 0.15, 0.12, 0, 0.45],
    "qd": [0.0] * 18,
}
TASK: dict[str, Any] = {
    "cell": "shared-workspace",
    "robot": {"q": HOME, "qd": [0.0] * 6},
    "people": [WALKER],
    "goal": [0.05, 0.75, 0.31],
    "checkpoint": GRID,
}


def asked(client: TestClient, **changes: Any) -> dict[str, Any]:
    return content_of(client.post(URL, json={**TASK, **changes}))


def refused(client: TestClient, status: int = 422, **changes: Any) -> dict[str, Any]:
    return problem_of(post_json(client, URL, {**TASK, **changes}), status)


BAD: list[tuple[dict[str, Any], int, str]] = [
    ({"cell": "moon"}, 422, "cell"),
    ({"cell": "pick-and-place"}, 409, "checkpoint"),
    ({"checkpoint": "nobody"}, 422, "checkpoint"),
    ({"checkpoint": "pick"}, 409, "checkpoint"),
    ({"frame": "world"}, 422, "frame"),
    ({"robot": {"q": HOME[:5], "qd": [0.0] * 6}}, 422, "robot.q"),
    ({"robot": {"q": [9.0, *HOME[1:]], "qd": [0.0] * 6}}, 422, "robot.q[0]"),
    ({"robot": {"q": HOME, "qd": [0, 0, 1.2, 0, 0, 0]}}, 422, "robot.qd[2]"),
    ({"robot": {"q": HOME, "qd": [0, 0, float("nan"), 0, 0, 0]}}, 422, "robot.qd[2]"),
    (
        {"robot": {"q": HOME, "qd": [0.0] * 6, "qdd": [0, 50, 0, 0, 0, 0]}, "checkpoint": JERK},
        422,
        "robot.qdd[1]",
    ),
    ({"goal": [0.0, 0.8]}, 422, "goal"),
    ({"goal": [0.0, float("inf"), 0.3]}, 422, "goal[1]"),
    ({"goal": [0.0, 1e300, 0.3]}, 422, "goal[1]"),
    ({"goal": "there"}, 422, "goal"),
    ({"inference_mode": "around"}, 422, "inference_mode"),
    ({"inference_mode": "interpolated", "checkpoint": BOX}, 422, "inference_mode"),
    ({"person_weighting": "farthest"}, 422, "person_weighting"),
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
