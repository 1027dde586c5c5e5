import asyncio
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.api.job_requests import shown
from app.api.routes.jobs import stream_job
from app.store import attempts, completion
from app.store.engine import Store
from app.store.jobs import create_job, get_job, request_cancel
from app.store.records import NewJob
from tests.api.answers import post_json, problem_of
from tests.api.conftest import services_of
from tests.sim.recorded_person import csv_text, working
from tests.support.databases import started
from tests.support.idle_service import idle_service

TINY = {
    "learning": {
        "total_steps": 1280,
        "n_envs": 128,
        "learning_starts": 0,
        "progress_steps": 128,
    }
}
TRAIN = {"kind": "train", "preset": "pick-td3", "seed": 1}


@pytest.fixture
def queued(client: TestClient) -> dict[str, Any]:
    """A job that was posted and cancelled at once: it costs the machine nothing."""
    job: dict[str, Any] = client.post("/v1/jobs", json=TRAIN).json()
    client.post(f"/v1/jobs/{job['id']}/cancel")
    return job


def test_posted_job_is_accepted_with_its_place(client: TestClient) -> None:
    answer = client.post("/v1/jobs", json={**TRAIN, "overrides": {"learning": {"gamma": 0.99}}})
    job = answer.json()
    assert answer.status_code == 202
    assert answer.headers["location"] == f"/v1/jobs/{job['id']}"
    assert job["spec"] == {**TRAIN, "overrides": {"learning": {"gamma": 0.99}}}
    cancelled = client.post(f"/v1/jobs/{job['id']}/cancel")
    assert cancelled.status_code == 202
    assert cancelled.json()["state"] in ("cancelling", "cancelled")


def test_same_key_never_makes_a_second_job(client: TestClient) -> None:
    headers = {"Idempotency-Key": "tests-1"}
    first = client.post("/v1/jobs", json=TRAIN, headers=headers).json()
    again = client.post("/v1/jobs", json=TRAIN, headers=headers)
    assert again.json()["id"] == first["id"]
    other = client.post("/v1/jobs", json={**TRAIN, "seed": 2}, headers=headers)
    assert other.status_code == 409
    client.post(f"/v1/jobs/{first['id']}/cancel")


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"kind": "bake"}, "kind"),
        ({"preset": "pick-td4"}, "preset"),
        ({"overrides": {"gama": 0.9}}, "overrides.gama"),
        ({"overrides": {"learning": {"gamma": 2.0}}}, "overrides.learning.gamma"),
        ({"overrides": {"learning": {"gamma": "high"}}}, "overrides.learning.gamma"),
        ({"seed": -1}, "seed"),
        ({"seed": "1"}, "seed"),
        ({"colour": "red"}, "colour"),
    ],
)
def test_bad_training_is_refused_by_field(
    client: TestClient, change: dict[str, Any], field: str
) -> None:
    problem = problem_of(client.post("/v1/jobs", json={**TRAIN, **change}))
    assert problem["field"] == field
    assert problem["rule"]


def test_override_that_is_not_finite_is_refused(client: TestClient) -> None:
    body = '{"kind": "train", "preset": "pick-td3", "overrides": {"learning": {"gamma": NaN}}}'
    problem = problem_of(post_json(client, "/v1/jobs", body))
    assert problem["field"] == "overrides.learning.gamma"


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"protocol": "pick-luck"}, "protocol"),
        ({"checkpoint": "best"}, "checkpoint"),
        ({"checkpoint": "reach"}, "checkpoint"),
    ],
)
def test_bad_evaluation_is_refused_by_field(
    client: TestClient, change: dict[str, Any], field: str
) -> None:
    body = {"kind": "evaluate", "protocol": "pick-single", "episodes": 10, **change}
    problem = problem_of(client.post("/v1/jobs", json=body))
    assert problem["field"] == field and "pick" in str(problem)


@pytest.fixture(scope="module")
def wave(client: TestClient) -> Iterator[str]:
    """A stored recording."""
    content = csv_text(working(100)).encode()
    client.post(
        "/v1/recordings?file_name=wave.csv&name=wave-of-jobs",
        content=content,
        headers={"Content-Type": "text/csv"},
    ).raise_for_status()
    yield "wave-of-jobs"
    client.delete("/v1/recordings/wave-of-jobs").raise_for_status()


@pytest.mark.parametrize(
    ("change", "field", "text"),
    [
        ({}, "recordings", "at least one motion"),
        ({"recordings": []}, "recordings", "at least one motion"),
        ({"recordings": ["nobody"]}, "recordings[0]", "wave-of-jobs"),
        ({"recordings": ["wave-of-jobs", "../../etc/passwd"]}, "recordings[1]", "wave-of-jobs"),
        ({"recordings": ["wave-of-jobs"] * 2}, "recordings[1]", "named once"),
        ({"recordings": [f"m{k}" for k in range(33)]}, "recordings", "32"),
        ({"recordings": ["x" * 65]}, "recordings[0]", "64"),
        ({"recordings": "wave-of-jobs"}, "recordings", "list"),
        (
            {"recordings": ["wave-of-jobs"], "protocol": "pick-people"},
            "recordings",
            "pick-mocap",
        ),
    ],
)
def test_bad_recordings_are_refused_by_field(
    client: TestClient, wave: str, change: dict[str, Any], field: str, text: str
) -> None:
    body = {"kind": "evaluate", "protocol": "pick-mocap", "episodes": 2, **change}
    problem = problem_of(client.post("/v1/jobs", json=body))
    assert problem["field"] == field and text in str(problem) and wave


def test_evaluation_beside_a_stored_recording_is_accepted(
    client: TestClient, wave: str
) -> None:
    body = {"kind": "evaluate", "protocol": "pick-mocap", "recordings": [wave], "episodes": 2}
    answer = client.post("/v1/jobs", json=body)
    job = answer.json()
    assert answer.status_code == 202
    assert job["spec"] == {**body, "checkpoint": "pick"}
    refused = client.delete(f"/v1/recordings/{wave}")
    assert (refused.status_code, refused.json()["field"]) == (409, "recording")
    client.post(f"/v1/jobs/{job['id']}/cancel")
    assert "event: end" in client.get(f"/v1/jobs/{job['id']}/events").text


def test_jobs_are_listed_in_pages_newest_first(
    client: TestClient, queued: dict[str, Any]
) -> None:
    newer = client.post("/v1/jobs", json=TRAIN).json()
    client.post(f"/v1/jobs/{newer['id']}/cancel")
    first = client.get("/v1/jobs", params={"limit": 1}).json()
    second = client.get("/v1/jobs", params={"limit": 1, "cursor": first["next_cursor"]}).json()
    assert [one["id"] for one in first["items"]] == [newer["id"]]
    assert [one["id"] for one in second["items"]] == [queued["id"]]


def test_list_shows_each_change_at_once(client: TestClient) -> None:
    def listed() -> list[tuple[str, str | None]]:
        page = client.get("/v1/jobs", params={"limit": 1, "part_of": "none"}).json()
        return [(one["id"], one["name"]) for one in page["items"]]

    job = client.post("/v1/jobs", json=TRAIN).json()["id"]
    client.post(f"/v1/jobs/{job}/cancel")
    client.get(f"/v1/jobs/{job}/events")  # ends with the job; it may have started
    assert listed() == listed() == [(job, None)]
    client.patch(f"/v1/jobs/{job}", json={"name": "renamed"})
    assert listed() == [(job, "renamed")]
    client.delete(f"/v1/jobs/{job}").raise_for_status()
    assert (job, "renamed") not in listed()


def test_list_shows_the_parts_of_one_job_only(client: TestClient) -> None:
    whole = client.post("/v1/jobs", json=TRAIN).json()["id"]
    client.post(f"/v1/jobs/{whole}/cancel")
    store = services_of(client).store
    part = create_job(store, NewJob(kind="count", spec={}, part_of=whole, trial=1)).id
    client.post(f"/v1/jobs/{part}/cancel")
    items = client.get("/v1/jobs", params={"part_of": whole}).json()["items"]
    assert [(one["id"], one["part_of"], one["trial"]) for one in items] == [(part, whole, 1)]
    items = client.get("/v1/jobs", params={"part_of": "none", "limit": 1}).json()["items"]
    assert items[0]["id"] == whole


def test_list_shows_the_jobs_of_a_kind_and_preset(
    client: TestClient, queued: dict[str, Any]
) -> None:
    other = client.post("/v1/jobs", json={**TRAIN, "preset": "reach-td3"}).json()
    client.post(f"/v1/jobs/{other['id']}/cancel")
    filters = {"kind": "train", "preset": "pick-td3", "limit": 1}
    page = client.get("/v1/jobs", params=filters).json()
    assert [one["id"] for one in page["items"]] == [queued["id"]]


@pytest.mark.parametrize(
    ("query", "field"),
    [
        ("limit=0", "limit"),
        ("cursor=x", "cursor"),
        ("state=odd", "state"),
        ("kind=odd", "kind"),
        ("preset=odd", "preset"),
    ],
)
def test_bad_query_is_refused_by_field(client: TestClient, query: str, field: str) -> None:
    assert problem_of(client.get(f"/v1/jobs?{query}"))["field"] == field


def test_unknown_job_is_not_found_on_every_route(client: TestClient) -> None:
    for path in ("", "/metrics", "/events", "/log"):
        problem_of(client.get(f"/v1/jobs/nothing{path}"), 404)
    assert client.post("/v1/jobs/nothing/cancel").status_code == 404


def test_output_of_a_job_is_text_of_which_the_end_can_be_asked_for(
    client: TestClient, queued: dict[str, Any]
) -> None:
    path = f"/v1/jobs/{queued['id']}/log"
    log = services_of(client).data / "logs" / f"{queued['id']}.log"
    log.unlink(missing_ok=True)
    assert client.get(path).text == ""
    log.parent.mkdir(exist_ok=True)
    log.write_bytes("first\ngr\u00fc\u00dfe ".encode() + b"\xff\n")
    answer = client.get(path)
    assert answer.headers["content-type"] == "text/plain; charset=utf-8"
    assert answer.text == "first\ngr\u00fc\u00dfe \ufffd\n"
    assert client.get(f"{path}?tail=4").text == "e \ufffd\n"
    assert problem_of(client.get(f"{path}?tail=0"))["field"] == "tail"


def test_stream_of_a_job_can_be_resumed_and_ends_with_it(client: TestClient) -> None:
    job = client.post("/v1/jobs", json={**TRAIN, "overrides": TINY}).json()
    client.post(f"/v1/jobs/{job['id']}/cancel")
    whole = client.get(f"/v1/jobs/{job['id']}/events").text
    assert whole.startswith("event: state\n")
    assert "event: end\n" in whole
    rest = client.get(f"/v1/jobs/{job['id']}/events", headers={"Last-Event-ID": "1"}).text
    assert "id: 1\n" in whole and "id: 1\n" not in rest
    assert "id: 2\n" in rest


def test_stream_after_an_event_that_a_restored_database_lacks_sends_later_ones(
    store: Store, tmp_path: Path
) -> None:
    services = idle_service(store, tmp_path)
    waiting = create_job(store, NewJob(kind="count", spec={}))
    stream = stream_job(waiting, services, 1000)
    request_cancel(store, waiting.id)

    async def sent() -> list[str | None]:
        return [one.event async for one in stream]

    assert asyncio.run(sent()) == ["state", "end"]


def test_training_that_ended_between_two_points_shows_the_last_one(
    store: Store, tmp_path: Path
) -> None:
    services = idle_service(store, tmp_path)
    claim = started(store)
    attempts.record_progress(store, claim, 100, {"success": 0.5})
    completion.finish(store, claim, result={"step": 128}, ended_by="time budget")
    job = shown(get_job(store, claim.job_id), services)
    assert (job.step, job.latest) == (128, {"success": 0.5})


def test_presets_are_described_for_a_form(client: TestClient) -> None:
    preset = client.get("/v1/presets").json()["items"][0]
    assert (preset["name"], preset["title"]) == ("pick-td3", "Pick and place (TD3)")
    field = {one["name"]: one for one in preset["fields"]}["learning.total_steps"]
    assert field["minimum"] <= field["default"] <= field["maximum"]
    assert field["unit"] and field["title"]


def test_a_preset_lists_the_names_that_a_choice_takes(client: TestClient) -> None:
    preset = client.get("/v1/presets").json()["items"][0]
    fields = {one["name"]: one for one in preset["fields"]}
    assert fields["action.bounds"]["choices"] == ["viable", "one-step"]
    assert fields["action.bounds"]["default"] == "viable"
    assert fields["action.meaning"]["minimum"] is None
    assert fields["action.degree"]["choices"] is None
