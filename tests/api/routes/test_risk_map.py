"""``POST /v1/risk-map``: the same choices as one by one, and what has none."""

from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from app.api.schemas.examples import RISK_MAP, TASK_SELECTION
from app.sim.human import model as human
from tests.api.answers import content_of

URL = "/v1/risk-map"


def person(x: float, y: float, yaw: float = -1.4) -> dict[str, Any]:
    q = human.rest_posture(x, y, yaw)
    q[10] = 0.6
    return {"q": q.tolist(), "qd": (0.1 * np.arange(18)).tolist()}


def mapped(client: TestClient, **changes: Any) -> dict[str, Any]:
    return content_of(client.post(URL, json=RISK_MAP | changes))


@pytest.mark.parametrize("objective", ["value", "success", "time"])
def test_each_position_has_the_answer_of_task_selection(
    client: TestClient, objective: str
) -> None:
    """Two people: the moved one is the nearer one in a part of the positions."""
    people = [person(0.3, 1.25), person(0.0, 1.5)]
    grid = {"x": [-0.4, 0.4], "y": [1.05, 1.6], "nx": 2, "ny": 3, "person": 1}
    terms = {"previous": "left", "time_left_s": 6.0, "objective": objective}
    found = mapped(client, people=people, grid=grid, **terms)
    for j, y in enumerate(found["y"]):
        for i, x in enumerate(found["x"]):
            there = [people[0], person(x, y)]
            answer = client.post(
                "/v1/task-selection", json=TASK_SELECTION | terms | {"people": there}
            )
            chosen = next(one for one in answer.json()["candidates"] if one["chosen"])
            assert found["chosen"][j][i] == chosen["id"]
            one = [found[name][j][i] for name in ("value", "success", "contact")]
            outcome = chosen["outcome"]
            expected = [chosen["value"], outcome["success"]["mean"], outcome["contact"]["mean"]]
            assert one == pytest.approx(expected, abs=1e-5)
            assert found["reason"][j][i] is None and found["clearance_m"][j][i] > 0.0


def test_a_cylinder_has_the_answers_of_task_selection_and_its_own_clearance(
    client: TestClient,
) -> None:
    grid = {"x": [-0.6, 0.9], "y": [0.8, 1.4], "nx": 3, "ny": 2}
    clearances = []
    for r in (0.1, 0.3, 2.0):
        one = {"x": 0.3, "y": 1.2, "vx": 0.0, "vy": 0.0, "r": r}
        other = person(-1.2, 1.6)
        found = mapped(client, people=[one, other], grid=grid)
        clearances.append(found["clearance_m"][1][1])
        for i, y in enumerate(found["y"]):
            for j, x in enumerate(found["x"]):
                if found["reason"][i][j] is not None:
                    assert r == 2.0
                    continue
                there = [{**one, "x": x, "y": y}, other]
                body = TASK_SELECTION | {"people": there}
                single = client.post("/v1/task-selection", json=body).json()
                values = {c["id"]: c["value"] for c in single["candidates"]}
                assert found["chosen"][i][j] == single["chosen"]
                np.testing.assert_allclose(
                    found["value"][i][j], values[single["chosen"]], atol=1e-5
                )
    assert clearances[0] - clearances[1] == pytest.approx(0.2, abs=1e-6)
    assert clearances[2] is None


def test_a_turn_of_the_person_changes_nothing(client: TestClient) -> None:
    grid = {"x": [-0.6, 0.9], "y": [0.8, 1.4], "nx": 3, "ny": 2}
    maps = [
        mapped(client, people=[person(0.3, 1.2, -1.4 + 2.0 * np.pi * k)], grid=grid)
        for k in (-3, -1, 0, 1, 2)
    ]
    for found in maps:
        for name in ("value", "clearance_m", "success"):
            np.testing.assert_allclose(found[name], maps[2][name], atol=1e-5)


def test_a_position_inside_the_robot_has_no_values_but_a_reason(client: TestClient) -> None:
    grid = {"x": [0.0, 0.0], "y": [0.25, 1.4], "nx": 1, "ny": 2}
    found = mapped(client, people=[person(0.0, 1.4)], grid=grid)
    assert found["reason"] == [["contact"], [None]]
    for name in ("chosen", "value", "success", "contact", "clearance_m"):
        assert found[name][0][0] is None and found[name][1][0] is not None


def test_a_hand_is_moved_as_far_as_it_reaches(client: TestClient) -> None:
    grid = {"what": "hand", "hand": "left", "x": [0.1, 0.1], "y": [-1.5, 1.0], "nx": 1, "ny": 2}
    found = mapped(client, people=[person(0.0, 1.4)], grid=grid)
    assert found["reason"] == [["unreachable"], [None]]
    rest = mapped(client, people=[person(0.0, 1.4)], grid=RISK_MAP["grid"])
    assert found["clearance_m"][1][0] < rest["clearance_m"][-1][1]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"person": 1}, ("grid.person", "1", "four people nearest", "choices: 0")),
        ({"x": [0.5, -0.5]}, ("grid.x", "[0.5, -0.5]", "in this order")),
        ({"y": [0.5, 0.5], "ny": 2}, ("grid.y", "[0.5, 0.5]", "must be two values for ny = 2")),
        ({"nx": 51}, ("grid.nx", "51", "50")),
        ({"what": "head"}, ("grid.what", "head", "person", "hand")),
        ({"height": 1.0}, ("grid.height", "1.0")),
    ],
)
def test_errors_name_field_value_and_rule(
    client: TestClient, change: dict[str, Any], words: tuple[str, ...]
) -> None:
    answer = client.post(URL, json=RISK_MAP | {"grid": RISK_MAP["grid"] | change})
    assert answer.status_code == 422
    assert [word for word in words if word not in answer.text] == []


def test_positions_and_times_outside_the_training_range_are_flagged(client: TestClient) -> None:
    grid = {"x": [-2.0, 0.0], "y": [1.3, 1.4], "nx": 3, "ny": 1}
    usual, late = (mapped(client, grid=grid, time_left_s=t) for t in (10.0, 50.0))
    assert usual["posture_outside"] == late["posture_outside"] == [[True, True, False]]
    assert [one["field"] for one in usual["state_outside"]] == []
    assert [one["field"] for one in late["state_outside"]] == ["time_left_s"]
