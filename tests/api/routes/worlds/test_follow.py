from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.api import following
from app.live.commands import SetPolicy
from app.storage_errors import StorageUnavailable
from app.store.checkpoints import drop_job_checkpoints
from tests.api.answers import problem_of
from tests.api.conftest import services_of
from tests.api.routes.worlds.live_world import WORLD, send, until

LEARNING = {
    "total_steps": 1280,
    "n_envs": 128,
    "buffer_size": 5000,
    "learning_starts": 0,
    "progress_steps": 128,
    "checkpoint_steps": 128,
}
TRAIN = {"kind": "train", "preset": "pick-td3", "seed": 1, "overrides": {"learning": LEARNING}}


def follow_of(client: TestClient) -> dict[str, Any]:
    (world,) = client.get("/v1/worlds").json()["items"]
    found: dict[str, Any] = world["follow"]
    return found


def test_newest_checkpoint_of_a_training_acts_until_its_end(client: TestClient) -> None:
    job = client.post("/v1/jobs", json=TRAIN).json()
    follow = client.put(f"{WORLD}/follow", json={"job": job["id"]})
    assert (follow.status_code, follow.json()["active"]) == (200, True)
    client.get(f"/v1/jobs/{job['id']}/events")  # ends with the job
    until(client, lambda _: not follow_of(client)["active"])
    ended = follow_of(client)
    last = client.get(f"/v1/jobs/{job['id']}").json()["result"]["checkpoint"]
    assert (ended["step"], ended["checkpoint"]) == (1280, last)
    assert ended["reason"] == f"job {job['number']} is succeeded: its last checkpoint acts"
    until(client, lambda world: world["checkpoint"] == last)
    refused = client.put(f"{WORLD}/follow", json={"job": job["id"]})
    assert (refused.status_code, refused.json()["field"]) == (409, "state")
    send(client, tag="set-policy", checkpoint="pick")


def test_following_ends_when_another_policy_is_chosen_or_asked_to(client: TestClient) -> None:
    job = client.post("/v1/jobs", json={**TRAIN, "priority": -100}).json()
    body = {"job": job["id"]}
    assert client.put(f"{WORLD}/follow", json=body).json()["active"]
    send(client, tag="set-policy", checkpoint="pick")
    assert follow_of(client)["reason"] == "another policy was chosen"
    assert client.put(f"{WORLD}/follow", json=body).json()["active"]
    assert client.delete(f"{WORLD}/follow").status_code == 204
    assert follow_of(client) is None
    assert client.put(f"{WORLD}/follow", json=body).json()["active"]
    world = services_of(client).worlds["main"]
    world.handle.submit(SetPolicy(checkpoint=None))  # as the 3D viewer, not by the API
    until(client, lambda _: not follow_of(client)["active"])
    assert follow_of(client)["reason"] == "another policy was chosen"
    send(client, tag="set-policy", checkpoint="pick")
    client.post(f"/v1/jobs/{job['id']}/cancel")


def test_own_policy_acts_again_where_a_restarted_training_lost_its_checkpoints(
    client: TestClient,
) -> None:
    send(client, tag="set-policy", checkpoint="pick")
    long = {"learning": {**LEARNING, "total_steps": 128_000}}
    job = client.post("/v1/jobs", json={**TRAIN, "overrides": long}).json()
    client.put(f"{WORLD}/follow", json={"job": job["id"]})
    until(
        client,
        lambda world: world["checkpoint"] == follow_of(client)["checkpoint"] is not None,
        within_s=240.0,  # a worker starts first
    )
    services = services_of(client)
    with services.follows.lock:  # nobody looks meanwhile
        client.post(f"/v1/jobs/{job['id']}/cancel")
        client.get(f"/v1/jobs/{job['id']}/events")  # ends with the job
        with services.store.writing() as connection:
            drop_job_checkpoints(connection, job["id"], beyond=-1)
    until(client, lambda _: not follow_of(client)["active"])
    ended = follow_of(client)
    assert (ended["step"], ended["checkpoint"]) == (None, None)
    assert ended["reason"] == f"job {job['number']} is cancelled: it has no checkpoint"
    own = client.get("/v1/checkpoints/pick").json()["sha256"]
    until(client, lambda world: world["checkpoint"] == own)


def test_follow_outlives_a_database_that_does_not_answer_for_now(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = client.post("/v1/jobs", json={**TRAIN, "priority": -100}).json()
    assert client.put(f"{WORLD}/follow", json={"job": job["id"]}).json()["active"]

    def away(*_: object, **__: object) -> None:
        raise StorageUnavailable("tandem.db", "database is locked")

    with monkeypatch.context() as patched:
        patched.setattr(following, "list_checkpoints", away)
        assert following.deploy_newest(services_of(client))
    assert follow_of(client)["active"]
    assert client.delete(f"{WORLD}/follow").status_code == 204
    client.post(f"/v1/jobs/{job['id']}/cancel")


def test_evaluation_and_unknown_job_are_not_followed(client: TestClient) -> None:
    body = {"kind": "evaluate", "protocol": "pick-single", "episodes": 1, "priority": -100}
    job = client.post("/v1/jobs", json=body).json()
    client.post(f"/v1/jobs/{job['id']}/cancel")
    refused = client.put(f"{WORLD}/follow", json={"job": job["id"]})
    assert (refused.status_code, refused.json()["field"]) == (409, "kind")
    unknown = problem_of(client.put(f"{WORLD}/follow", json={"job": "gone"}))
    assert (unknown["field"], unknown["value"]) == ("job", "'gone'")
    assert client.put("/v1/worlds/x/follow", json={"job": "gone"}).status_code == 404
