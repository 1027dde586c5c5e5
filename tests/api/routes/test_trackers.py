"""Streams of key-points over HTTP: who is followed, what is named, what is refused."""

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from app.sim.cells.cell import load_cell
from app.sim.perception.keypoints import K
from tests.api.answers import problem_of
from tests.api.conftest import services_of
from tests.api.routes.test_task_selection import URL, refused
from tests.sim.tracked_person import CELL, RATE_HZ, seen, work

TRACKERS = "/v1/trackers"
FIRST, SECOND = work(1, 12.0), work(2, 12.0)
APART = np.array([1.6, 0.0, 0.0])


@pytest.fixture
def tracker(client: TestClient) -> Iterator[str]:
    made = client.post(TRACKERS, json={"cell": "pick-and-place", "n_people": 2})
    assert made.status_code == 201, made.text
    place = made.headers["location"]
    assert place == f"{TRACKERS}/{made.json()['id']}"
    yield place
    client.delete(place)


def points(q: np.ndarray, offset: np.ndarray | float = 0.0) -> list[Any]:
    found: list[Any] = (seen(q) + offset).tolist()
    return found


def frame(t: float, *people: list[Any]) -> dict[str, Any]:
    return {"t": t, "people": [{"keypoints": one} for one in people]}


def fed(client: TestClient, tracker: str, n: int) -> dict[str, Any]:
    """Hand over the first frames of two people; return the last answer."""
    for k in range(n):
        both = points(FIRST[1][k]), points(SECOND[1][k], APART)
        answer = client.post(f"{tracker}/frames", json=frame(k / RATE_HZ, *both))
        assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


def test_two_people_are_followed_with_angles_speeds_and_cylinders(
    client: TestClient, tracker: str
) -> None:
    people = fed(client, tracker, 20)["people"]
    for person, (_, q, qd), offset in zip(people, (FIRST, SECOND), (0.0, 1.6), strict=True):
        assert person["flags"] == [] and not person["stale"]
        assert person["q"][0] == pytest.approx(q[19][0] + offset, abs=0.02)
        assert np.abs(np.array(person["q"][10:]) - q[19][10:]).max() < 0.25
        assert np.median(np.abs(np.array(person["qd"]) - qd[19])) < 0.3
        away = np.array(person["cylinder"]["center"]) - person["q"][:2]
        assert np.linalg.norm(away) < 0.4 and 0.2 < person["cylinder"]["radius"] < 1.2


def test_exchanged_people_keep_their_places_and_it_is_named(
    client: TestClient, tracker: str
) -> None:
    before = fed(client, tracker, 10)["people"]
    other = frame(10 / RATE_HZ, points(SECOND[1][10], APART), points(FIRST[1][10]))
    after = client.post(f"{tracker}/frames", json=other).json()["people"]
    for one, two in zip(before, after, strict=True):
        assert "people-swapped" in two["flags"]
        assert two["q"][0] == pytest.approx(one["q"][0], abs=0.05)


def test_empty_observation_becomes_stale(client: TestClient, tracker: str) -> None:
    fed(client, tracker, 10)
    gone = client.post(f"{tracker}/frames", json=frame(2.0)).json()["people"]
    assert all(one["stale"] and "stale" in one["flags"] for one in gone)
    assert all(one["age_s"] == pytest.approx(2.0 - 9 / RATE_HZ) for one in gone)
    assert gone[0]["cylinder"]["radius"] > 1.5


def test_no_people_before_the_first_observation(client: TestClient, tracker: str) -> None:
    person = client.post(f"{tracker}/frames", json=frame(0.0)).json()["people"][0]
    assert person["flags"] == ["never-seen"]
    assert person["q"] is person["cylinder"] is person["age_s"] is None


def test_estimates_of_a_later_time_are_predicted(client: TestClient, tracker: str) -> None:
    last = fed(client, tracker, 40)
    later = client.get(tracker, params={"t": last["t"] + 0.1}).json()
    one, two = (answer["people"][1] for answer in (last, later))
    assert two["age_s"] >= 0.1 - 1e-9
    assert np.abs(np.array(two["q"]) - one["q"]).max() > 0.02


def test_a_tracker_that_fell_silent_is_stale_wherever_it_is_named(
    client: TestClient, tracker: str, state: dict[str, Any]
) -> None:
    fed(client, tracker, 10)
    time.sleep(0.3)
    named = {"tracker": tracker.rpartition("/")[2], "person": 0}
    known = client.get(tracker).json()["people"][0]
    chosen = client.post(URL, json={**state, "people": [named]}).json()["people"][0]
    for person in (known, chosen):
        assert person["age_s"] >= 0.3 and "stale" in person["flags"]


def test_a_clock_that_is_set_back_is_followed_after_a_few_frames(
    client: TestClient, tracker: str
) -> None:
    fed(client, tracker, 10)
    answers = [
        client.post(f"{tracker}/frames", json=frame(-2.0 + k / RATE_HZ, points(FIRST[1][10])))
        for k in range(4)
    ]
    assert [one.status_code for one in answers] == [409, 409, 200, 200]
    problem = answers[0].json()
    assert problem["field"] == "t" and problem["consistent_frames"] == 1
    assert "delete the tracker" in problem["detail"]
    assert "clock-jump" in answers[2].json()["people"][0]["flags"]
    assert "clock-jump" not in answers[3].json()["people"][0]["flags"]


def test_frames_after_one_wild_stamp_are_taken(client: TestClient, tracker: str) -> None:
    fed(client, tracker, 10)
    wild = client.post(f"{tracker}/frames", json=frame(86400.0, points(FIRST[1][10])))
    assert wild.status_code == 409
    assert {"clock-jump", "stale"} <= set(client.get(tracker).json()["people"][0]["flags"])
    for k in range(10, 40):
        taken = client.post(f"{tracker}/frames", json=frame(k / RATE_HZ, points(FIRST[1][k])))
        assert taken.status_code == 200 and taken.json()["people"][0]["flags"] == []


def test_followed_people_can_be_named_in_a_decision(
    client: TestClient, state: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    sessions = services_of(client).trackers
    now = sessions.clock()
    monkeypatch.setattr(sessions, "clock", lambda: now)  # people do not move on meanwhile
    identity = client.post(TRACKERS, json={"cell": CELL.name, "n_people": 2}).json()["id"]
    known = fed(client, f"{TRACKERS}/{identity}", 20)["people"]
    named = [{"tracker": identity, "person": i} for i in range(2)]
    answer = client.post(URL, json={**state, "people": named}).json()
    client.delete(f"{TRACKERS}/{identity}")
    by_hand = [{"q": one["q"], "qd": one["qd"], "size": CELL.body.tolist()} for one in known]
    same = client.post(URL, json={**state, "people": by_hand}).json()
    assert [one["by"] for one in answer["people"]] == ["tracker"] * 2
    assert [one["speeds"] for one in answer["people"]] == ["estimated"] * 2
    assert [one["value"] for one in answer["candidates"]] == pytest.approx(
        [one["value"] for one in same["candidates"]], abs=1e-6
    )


@pytest.mark.parametrize(
    ("change", "field", "rule"),
    [
        ({"person": 3}, "people[0].person", "must be less than 2"),
        ({"t": 1e11}, "people[0].t", "must be at most"),
        ({"tracker": "gone"}, "people[0].tracker", "not an open tracker"),
    ],
)
def test_person_that_is_not_tracked_is_refused(
    client: TestClient,
    tracker: str,
    state: dict[str, Any],
    change: dict[str, Any],
    field: str,
    rule: str,
) -> None:
    client.post(f"{tracker}/frames", json=frame(1.0, points(FIRST[1][0])))
    person = {"tracker": tracker.rpartition("/")[2], "person": 0, **change}
    problem = refused(client, {**state, "people": [person]})
    assert problem["field"] == field and rule in problem["rule"]


@pytest.mark.parametrize(
    ("t", "rule"),
    [(1.7e308, "must be at most"), (-1e11, "must be at least"), ("nan", "finite")],
)
def test_present_beyond_any_clock_is_refused(
    client: TestClient, tracker: str, t: float | str, rule: str
) -> None:
    fed(client, tracker, 2)
    problem = problem_of(client.get(tracker, params={"t": t}))
    assert problem["field"] == "t" and rule in problem["rule"]
    latest = client.get(tracker, params={"t": 1e10}).json()["people"][0]
    assert latest["cylinder"]["radius"] > 1e10


@pytest.mark.parametrize(
    ("body", "field", "rule"),
    [
        (frame(0.5, *[points(FIRST[1][0])] * 65), "people", "at most 64"),
        (frame(0.5, points(FIRST[1][0])[:20]), "people[0].keypoints", "at least 25"),
        ({"people": []}, "t", "is required"),
        ({"t": 1e300, "people": []}, "t", "must be at most"),
    ],
)
def test_a_frame_that_cannot_be_is_refused_and_leaves_no_trace(
    client: TestClient, tracker: str, body: dict[str, Any], field: str, rule: str
) -> None:
    before = fed(client, tracker, 12)
    problem = problem_of(client.post(f"{tracker}/frames", json=body))
    assert problem["field"] == field and rule in problem["rule"]
    assert client.get(tracker).json()["t"] >= before["t"]
    listed = {one["id"]: one for one in client.get(TRACKERS).json()["items"]}
    mine = listed[tracker.rpartition("/")[2]]
    assert mine["n_frames"] == 12 and mine["t"] == before["t"]


def test_people_beyond_the_limit_leave_tracked_ones_unchanged(
    client: TestClient, tracker: str
) -> None:
    fed(client, tracker, 5)
    near = points(FIRST[1][5]), points(SECOND[1][5], APART)
    far = points(FIRST[1][5], [0.0, 4.0, 0.0]), points(FIRST[1][5], [0.0, 2.0, 0.0])
    sent = frame(5 / RATE_HZ, far[0], near[0], far[1], near[1])
    answer = client.post(f"{tracker}/frames", json=sent).json()
    for k, person in enumerate(answer["people"]):
        assert person["age_s"] == 0.0 and not person["stale"]
        assert "people-dropped" in person["flags"]
        true = near[k][K["mid_hip"]][0]
        assert person["q"][0] == pytest.approx(true, abs=0.05)
    assert [(one["index"], one["reason"]) for one in answer["unassigned"]] == [
        (2, "farther"),
        (0, "farther"),
    ]
    assert client.get(tracker).json()["unassigned"] == answer["unassigned"]


def test_person_in_another_frame_is_reported_and_others_are_tracked(
    client: TestClient, tracker: str
) -> None:
    fed(client, tracker, 5)
    wrong = (1000.0 * seen(FIRST[1][5])).tolist()
    sent = frame(5 / RATE_HZ, wrong, points(SECOND[1][5], APART))
    lost, followed = client.post(f"{tracker}/frames", json=sent).json()["people"]
    assert lost["flags"] == ["foreign-frame"] and lost["age_s"] > 0.0
    assert "millimetres" in lost["implausible"]
    assert followed["flags"] == [] and followed["age_s"] == 0.0


def test_frames_of_another_frame_alone_never_count_as_seen(
    client: TestClient, tracker: str
) -> None:
    for k in range(20):
        sent = frame(k / RATE_HZ, points(FIRST[1][k], [0.0, 0.0, 2.0]))
        person = client.post(f"{tracker}/frames", json=sent).json()["people"][0]
        assert person["stale"] and person["age_s"] is None and person["q"] is None
        assert {"never-seen", "foreign-frame"} <= set(person["flags"])
        assert "over the floor" in person["implausible"]


def test_a_deleted_tracker_is_gone(client: TestClient) -> None:
    place = client.post(TRACKERS, json={"cell": "pick-and-place"}).headers["location"]
    assert place.rpartition("/")[2] in [
        one["id"] for one in client.get(TRACKERS).json()["items"]
    ]
    assert client.delete(place).status_code == 204
    for answer in (client.get(place), client.delete(place)):
        assert answer.status_code == 404
    assert client.post(f"{place}/frames", json=frame(0.0)).status_code == 404


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"cell": "kitchen"}, "cell"),
        ({"n_people": 5}, "n_people"),
        ({"n_people": 0}, "n_people"),
    ],
)
def test_a_tracker_that_cannot_be_is_refused(
    client: TestClient, change: dict[str, Any], field: str
) -> None:
    answer = client.post(TRACKERS, json={"cell": "pick-and-place", **change})
    assert problem_of(answer)["field"] == field


def test_motion_names_all_people_of_a_tracker(client: TestClient) -> None:
    place = client.post(TRACKERS, json={"cell": "shared-workspace", "n_people": 3}).headers
    identity = place["location"].rpartition("/")[2]
    people = [{"tracker": identity, "person": i} for i in range(3)]
    robot = {"q": list(load_cell("shared-workspace").robot.home_q), "qd": [0.0] * 6}
    task = {"cell": "shared-workspace", "robot": robot, "goal": [0.05, 0.75, 0.31]}
    answers = [
        client.post("/v1/motion", json={**task, "people": named})
        for named in (people, [*people, people[0]], people[1:2])
    ]
    client.delete(place["location"])
    assert [one.status_code for one in answers] == [200, 200, 422]
    assert answers[2].json()["field"] == "people"
    assert answers[2].json()["rule"].endswith("left out: 0, 2")
