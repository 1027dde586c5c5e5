from fastapi.testclient import TestClient

from app.policies.evaluation.registry import PROTOCOLS


def test_protocols_state_what_they_take(client: TestClient) -> None:
    found = {one["name"]: one for one in client.get("/v1/protocols").json()["items"]}
    assert list(found) == list(PROTOCOLS)
    assert found["pick-mocap"]["recordings"] == "required"
    assert found["reach-ssm"] == {
        "name": "reach-ssm",
        "title": "Compare a policy with planners under the safety layer.",
        "purpose": "reaching goals",
        "checkpoint": "reach",
        "max_episodes": 20_000,
        "recordings": "optional",
    }
    assert (found["safety-ssm"]["checkpoint"], found["safety-ssm"]["recordings"]) == (
        None,
        "none",
    )
    aliases = {one["name"] for one in client.get("/v1/aliases").json()["items"]}
    assert {one["checkpoint"] for one in found.values()} <= {*aliases, None}
