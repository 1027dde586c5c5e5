from fastapi.testclient import TestClient
from safetensors.numpy import load

from app.policies.checkpoints import checkpoint


def test_shipped_checkpoint_is_listed_with_its_alias(client: TestClient) -> None:
    listed = client.get("/v1/checkpoints").json()["items"]
    shipped = [one for one in listed if "pick" in one["aliases"]]
    assert len(shipped) == 1
    assert shipped[0]["preset"] == "pick-td3"
    assert shipped[0]["purpose"] == "choosing tasks"
    assert client.get("/v1/checkpoints/pick").json()["sha256"] == shipped[0]["sha256"]


def test_downloaded_tensors_and_manifest_make_the_same_checkpoint(client: TestClient) -> None:
    sha256 = client.get("/v1/checkpoints/pick").json()["sha256"]
    answer = client.get(f"/v1/checkpoints/{sha256}/tensors")
    assert answer.headers["content-type"] == "application/octet-stream"
    assert load(answer.content)
    manifest = client.get(f"/v1/checkpoints/{sha256}/manifest").json()
    assert checkpoint.load(manifest, answer.content).sha256 == sha256


def test_unknown_checkpoint_is_not_found(client: TestClient) -> None:
    for path in ("", "/tensors", "/manifest"):
        answer = client.get(f"/v1/checkpoints/{'0' * 64}{path}")
        assert answer.status_code == 404
