from typing import Any

from fastapi.testclient import TestClient

from tests.api.routes.worlds.test_worlds import COMMANDS, WORLD, until

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
    client.post(COMMANDS, json={"tag": "set-policy", "checkpoint": "pick"})


def test_following_ends_when_another_policy_is_chosen_or_asked_to(client: TestClient) -> None:
    job = client.post("/v1/jobs", json={**TRAIN, "priority": -100}).json()
    body = {"job": job["id"]}
    assert client.put(f"{WORLD}/follow", json=body).json()["active"]
    client.post(COMMANDS, json={"tag": "set-policy", "checkpoint": "pick"})
    assert follow_of(client)["reason"] == "another policy was chosen"
    assert client.put(f"{WORLD}/follow", json=body).json()["active"]
    assert client.delete(f"{WORLD}/follow").status_code == 204
    assert follow_of(client) is None
    client.post(f"/v1/jobs/{job['id']}/cancel")


def test_evaluation_and_unknown_job_are_not_followed(client: TestClient) -> None:
    body = {"kind": "evaluate", "protocol": "pick-single", "episodes": 1, "priority": -100}
    job = client.post("/v1/jobs", json=body).json()
    client.post(f"/v1/jobs/{job['id']}/cancel")
    refused = client.put(f"{WORLD}/follow", json={"job": job["id"]})
    assert (refused.status_code, refused.json()["field"]) == (409, "kind")
    assert client.put(f"{WORLD}/follow", json={"job": "gone"}).status_code == 404
