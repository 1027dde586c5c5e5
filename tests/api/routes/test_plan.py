"""``POST /v1/plan``: sorting task, robot and people in; next move and motion out."""

from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.api.schemas.examples import PLAN
from tests.api.answers import content_of, problem_of

URL = "/v1/plan"


def asked(client: TestClient, **changes: Any) -> dict[str, Any]:
    return content_of(client.post(URL, json=PLAN | changes))


def refused(client: TestClient, status: int = 422, **changes: Any) -> dict[str, Any]:
    return problem_of(client.post(URL, json=PLAN | changes), status)


def test_answer_names_symbol_object_place_and_first_segment(client: TestClient) -> None:
    answer = asked(client, stamp=7)
    assert (answer["symbol"], answer["solved"], answer["stamp"]) == ("pick", False, 7)
    assert answer["move"]["object"] in ("a", "b")
    assert answer["move"]["place"]["station"] == answer["move"]["colour"]
    assert [one["chosen"] for one in answer["moves"]].count(True) == 1
    chosen = next(one for one in answer["moves"] if one["chosen"])
    assert chosen["object"] == answer["move"]["object"]
    assert answer["target"] == chosen["to_object"]["position"]
    for one in answer["moves"]:
        values = one["to_object"]["value"] + one["to_place"]["value"]
        assert one["score"] == pytest.approx(values)
    assert chosen["score"] == max(one["score"] for one in answer["moves"])
    start = [row[0] for row in answer["segment"]["coefficients"]]
    assert start == PLAN["robot"]["q"] and answer["segment"]["until"] == answer["dt"]


def test_place_follows_the_pick_and_the_last_object_solves_the_task(client: TestClient) -> None:
    held = asked(client, held="b")
    assert (held["symbol"], held["move"]["object"]) == ("place", "b")
    assert held["moves"][0]["to_object"] is None
    assert held["target"] == held["moves"][0]["to_place"]["position"]
    done = [
        {"colour": "red", "size": "large", "at": "red", "level": 0},
        {"colour": "red", "size": "small", "at": "red", "level": 1},
    ]
    solved = asked(client, objects=done)
    assert solved["solved"] and solved["move"] is solved["segment"] is solved["symbol"] is None
    assert solved["moves"] == []


def test_object_that_must_wait_is_returned(client: TestClient) -> None:
    answer = asked(client, held="c")
    assert answer["symbol"] == "return" and not answer["solved"]
    assert answer["move"]["place"] == answer["move"]["pick"]


@pytest.mark.parametrize("objective", ["success", "time"])
def test_objective_orders_the_moves_by_the_predicted_outcome(
    client: TestClient, objective: str
) -> None:
    answer = asked(client, objective=objective)

    def score(one: dict[str, Any]) -> float:
        outcomes = [one[name]["outcome"] for name in ("to_object", "to_place")]
        success: float = outcomes[0]["success"]["mean"] * outcomes[1]["success"]["mean"]
        time_s = outcomes[0]["time_s"] + outcomes[1]["time_s"]
        return success if objective == "success" else -time_s / success

    best = max(answer["moves"], key=score)
    assert best["chosen"]
    assert best["score"] == pytest.approx(score(best))


def test_no_people_are_no_error_and_each_person_is_reported(client: TestClient) -> None:
    assert asked(client, people=[])["people"] == []
    far = {"x": 4.0, "y": 4.0, "vx": 0.0, "vy": 0.0, "r": 0.3}
    answer = asked(client, people=[far, *PLAN["people"]])
    assert [one["used"] for one in answer["people"]] == [False, True]


def test_wide_margin_offers_moves_with_more_attempts(client: TestClient) -> None:
    other = {"id": "d", "colour": "red", "size": "large", "at": "slot2"}
    objects = [*PLAN["objects"], other]
    narrow, wide = (asked(client, objects=objects, margin=m) for m in (0.0, 1.0))
    assert {one["object"] for one in narrow["moves"]} == {"a", "b"}
    assert {one["object"] for one in wide["moves"]} == {"a", "b", "d"}


@pytest.mark.parametrize(
    ("changes", "field", "rule"),
    [
        ({"held": "z"}, "held", "must be the id of one of the objects"),
        ({"cell": "pick-and-place"}, "cell", "needs stations of kind clutter"),
        ({"cell": "nowhere"}, "cell", "is not a known work cell"),
        ({"goal": {"red": ["medium"]}}, "goal", "must be met by the objects"),
        ({"margin": 11.0}, "margin", "must be at most 10"),
        ({"robot": {"q": [0.0] * 6, "qd": [9.0] * 6}}, "robot.qd[0]", "must lie in"),
        ({"checkpoint": "none"}, "checkpoint", "is not a stored checkpoint"),
        ({"layout": {}}, "layout", "is not a known field"),
    ],
)
def test_problem_names_field_and_rule(
    client: TestClient, changes: dict[str, Any], field: str, rule: str
) -> None:
    problem = refused(client, **changes)
    assert problem["field"] == field
    assert rule in problem["detail"]


def test_held_object_below_another_is_refused(client: TestClient) -> None:
    tower = [
        {"id": "a", "colour": "red", "size": "large", "at": "red", "level": 0},
        {"id": "b", "colour": "red", "size": "small", "at": "red", "level": 1},
    ]
    problem = refused(client, objects=tower, held="a")
    assert (problem["field"], problem["rule"]) == ("held", "must be the top object of red")


def test_policy_that_sorts_is_refused(client: TestClient) -> None:
    assert refused(client, 409, checkpoint="sorting-e0")["status"] == 409


@pytest.mark.parametrize(
    "changes",
    [{"previous": "nowhere"}, {"phase": "lift"}, {"previous": "nowhere", "phase": "descend"}],
    ids=str,
)
def test_previous_is_a_station(client: TestClient, changes: dict[str, Any]) -> None:
    found = refused(client, **changes)
    assert found["field"] == "previous" and "red" in found["choices"]


def test_lift_of_an_object_that_is_not_offered_is_refused(client: TestClient) -> None:
    found = refused(client, previous="blue", phase="lift")
    assert (found["field"], found["value"]) == ("previous", "'blue'")
    assert "offered motion in the phase lift" in found["rule"]
    offered = [one["pick"]["station"] for one in asked(client)["moves"]]
    assert set(found["choices"]) == set(offered)
    assert asked(client, previous="blue")["symbol"] == "pick"
