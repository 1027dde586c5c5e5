import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from safetensors.numpy import load, save

from app.policies.checkpoints import checkpoint, pretrained
from app.policies.checkpoints.upload import MAX_FILE, MAX_MANIFEST
from tests.api.answers import problem_of
from tests.api.routes.motion.motion_requests import TASK
from tests.policies.untrained import overflowing
from tests.support import workshop


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


FILE = {"Content-Type": "application/octet-stream"}


def uploaded(manifest: dict[str, Any], tensors: bytes) -> bytes:
    return json.dumps(manifest).encode() + b"\n" + tensors


def changed(change: dict[str, Any], alias: str = "reach") -> bytes:
    """Return the upload of a shipped checkpoint with other manifest fields."""
    shipped = pretrained.load(alias)
    return uploaded({**shipped.manifest, **change}, shipped.tensors)


def with_tensor(name: str, values: Any) -> bytes:
    shipped = pretrained.load("reach")
    return uploaded(shipped.manifest, save({**shipped.arrays(), name: values}))


@pytest.fixture
def alias(client: TestClient) -> Iterator[str]:
    client.put("/v1/aliases/line-2", json={"checkpoint": "reach"})
    yield "line-2"
    client.delete("/v1/aliases/line-2")


def test_uploaded_checkpoint_decides_by_its_id(client: TestClient) -> None:
    body = changed({"seed": 77})
    answer = client.post("/v1/checkpoints", content=body, headers=FILE)
    assert answer.status_code == 201, answer.text
    sha256 = answer.json()["sha256"]
    assert answer.headers["location"] == f"/v1/checkpoints/{sha256}"
    assert client.post("/v1/checkpoints", content=body, headers=FILE).status_code == 200
    moved = client.post("/v1/motion", json={**TASK, "checkpoint": sha256})
    assert moved.json()["checkpoint"] == sha256


def test_upload_with_another_id_than_expected_is_refused(client: TestClient) -> None:
    body = changed({"seed": 78})
    answer = client.post("/v1/checkpoints?sha256=" + "0" * 64, content=body, headers=FILE)
    assert (answer.status_code, answer.json()["field"]) == (422, "sha256")


KINDS = ("pick", "reach", "sorting-e0")
GARAGE = workshop.definition()
GARAGE["robot"] = {**GARAGE["robot"], "dt": 50.0}
NAN = np.full(6, np.nan, dtype=np.float32)
WRONG = [
    (b"", "body"),
    (b"{" * 99 + b"\n", "manifest"),
    (b"\x80\x04K\x01.\n", "manifest"),
    (b'{"seed": NaN}\nx', "manifest"),
    (b" " * (MAX_MANIFEST + 1) + b"\n", "body"),
    (changed({"kind": "resume"}), "manifest.kind"),
    (changed({"trained_range": {"q": {"low": [0], "high": []}}}), "manifest.trained_range.q"),
    (uploaded(pretrained.load("reach").manifest, b""), "tensors"),
    (uploaded(pretrained.load("reach").manifest, b"\x80\x04K\x01."), "tensors"),
    (with_tensor("actor.net.4.bias", NAN), "tensors.actor.net.4.bias"),
    (
        changed({"preset": {"networks": {"width": 4096, "layers": 4}}}),
        "manifest.preset.networks.width",
    ),
    *((changed({"preset": {"name": {}}}, one), "manifest.preset.name") for one in KINDS),
    *((changed({"cell": "garage"}, one), "manifest.cell") for one in KINDS),
    (changed({"preset": {}}), "manifest.preset"),
    (changed({"cell_definition": GARAGE}), "manifest.cell_definition.robot.dt"),
    (changed({"trained_range": {}}), "manifest.trained_range.q"),
    (changed({"trained_range": {}}, "pick"), "manifest.trained_range.q"),
    (changed({"seed": -1}), "manifest.seed"),
    (changed({"step": 10**30}), "manifest.step"),
    (changed({"updates": True}), "manifest.updates"),
    (changed({"cpu_s": "long"}), "manifest.cpu_s"),
    (changed({"versions": [3]}), "manifest.versions"),
    (changed({"commits": {}}), "manifest.commits"),
]


@pytest.mark.parametrize(("body", "field"), WRONG, ids=[one[1] for one in WRONG])
def test_bad_upload_is_refused_by_field(client: TestClient, body: bytes, field: str) -> None:
    answer = client.post("/v1/checkpoints", content=body, headers=FILE)
    assert (answer.status_code, answer.json()["field"]) == (422, field), answer.text


def test_upload_whose_tensors_do_not_fit_is_refused(client: TestClient) -> None:
    body = with_tensor("actor.net.4.bias", np.zeros(5, dtype=np.float32))
    answer = client.post("/v1/checkpoints", content=body, headers=FILE)
    assert (answer.status_code, answer.json()["property"]) == (409, "tensors.actor.net.4")


@pytest.mark.parametrize(
    ("alias", "number"), [("pick", "action"), ("reach", "action"), ("sorting-e0", "value")]
)
def test_upload_whose_numbers_overflow_is_refused(
    client: TestClient, alias: str, number: str
) -> None:
    found = overflowing(alias)
    body = uploaded(found.manifest, found.tensors)
    refused = problem_of(client.post("/v1/checkpoints", content=body, headers=FILE), 409)
    assert (refused["field"], refused["property"]) == ("checkpoint", number)
    assert refused["value"] == f"<{number} 'NaN or infinite'>"
    assert refused["rule"] == f"must have the {number} 'finite numbers'"


def test_upload_over_the_limit_is_refused(client: TestClient) -> None:
    answer = client.post("/v1/checkpoints", content=b"{}\n" + bytes(MAX_FILE), headers=FILE)
    assert answer.status_code == 413


def test_alias_can_be_used_where_a_checkpoint_is_named(client: TestClient, alias: str) -> None:
    sha256 = pretrained.SHA256["reach"]
    assert client.get(f"/v1/checkpoints/{alias}").json()["sha256"] == sha256
    moved = client.post("/v1/motion", json={**TASK, "checkpoint": alias})
    assert moved.json()["checkpoint"] == sha256
    listed = client.get("/v1/aliases").json()["items"]
    assert {"name": alias, "checkpoint": sha256, "shipped": False} in listed


def test_alias_points_to_another_checkpoint_in_one_step(client: TestClient, alias: str) -> None:
    answer = client.put(f"/v1/aliases/{alias}", json={"checkpoint": "pick"})
    assert (answer.status_code, answer.json()["checkpoint"]) == (200, pretrained.SHA256["pick"])
    refused = client.post("/v1/motion", json={**TASK, "checkpoint": alias})
    assert refused.status_code == 409


def test_alias_of_a_shipped_checkpoint_stays(client: TestClient) -> None:
    taken = problem_of(client.put("/v1/aliases/pick", json={"checkpoint": "reach"}), 409)
    assert (taken["field"], taken["value"]) == ("name", "'pick'")
    assert "choose another name" in taken["rule"]
    kept = problem_of(client.delete("/v1/aliases/pick"), 409)
    assert kept["rule"].endswith("shipped aliases cannot be deleted")


def test_unknown_alias_and_checkpoint_are_named(client: TestClient) -> None:
    assert client.delete("/v1/aliases/nothing").status_code == 404
    answer = client.put("/v1/aliases/mine", json={"checkpoint": "nothing"})
    assert (answer.status_code, answer.json()["field"]) == (422, "checkpoint")
    answer = client.put("/v1/aliases/MINE", json={"checkpoint": "reach"})
    assert (answer.status_code, answer.json()["field"]) == (422, "alias")


def test_uploaded_checkpoint_is_deleted_and_decides_no_longer(client: TestClient) -> None:
    body = changed({"seed": 79})
    sha256 = client.post("/v1/checkpoints", content=body, headers=FILE).json()["sha256"]
    path, task = f"/v1/checkpoints/{sha256}", {**TASK, "checkpoint": sha256}
    assert client.post("/v1/motion", json=task).status_code == 200
    client.put("/v1/aliases/line-3", json={"checkpoint": sha256})
    refused = client.delete("/v1/checkpoints/line-3")
    assert (refused.status_code, refused.json()["field"]) == (409, "alias")
    client.delete("/v1/aliases/line-3")
    assert client.delete(path).status_code == 204
    assert client.delete(path).status_code == 404
    assert client.post("/v1/motion", json=task).json()["field"] == "checkpoint"
    assert client.post("/v1/checkpoints", content=body, headers=FILE).status_code == 201


def test_shipped_checkpoint_is_not_deleted(client: TestClient) -> None:
    for reference in ("reach", pretrained.SHA256["reach"]):
        answer = client.delete(f"/v1/checkpoints/{reference}")
        assert answer.status_code == 409 and "shipped" in answer.json()["detail"]


CAME = [{"success": 0.9, "contact": 0.05, "outcome": "timeout"}] * 30


def test_recalibrated_checkpoint_predicts_what_was_observed(
    client: TestClient, state: dict[str, Any]
) -> None:
    answer = client.post("/v1/checkpoints/pick/recalibration", json={"outcomes": CAME})
    assert answer.status_code == 201, answer.text
    made = answer.json()
    assert answer.headers["location"] == f"/v1/checkpoints/{made['sha256']}"
    assert made["manifest"]["recalibration"]["outcomes"] == {
        "success": 0,
        "contact": 0,
        "timeout": 30,
    }
    again = client.post("/v1/checkpoints/pick/recalibration", json={"outcomes": CAME})
    assert (again.status_code, again.json()["sha256"]) == (200, made["sha256"])
    before, after = (
        client.post("/v1/task-selection", json={**state, "checkpoint": one}).json()
        for one in ("pick", made["sha256"])
    )
    for old, new in zip(before["candidates"], after["candidates"], strict=True):
        assert old["value"] == new["value"]
        assert new["outcome"]["success"]["mean"] < old["outcome"]["success"]["mean"] - 0.3


@pytest.mark.parametrize(
    ("reference", "change", "field"),
    [
        ("pick", {"outcomes": CAME[:19]}, "outcomes"),
        ("pick", {"outcomes": [{**CAME[0], "success": 1.5}] * 30}, "outcomes[0].success"),
        ("pick", {"outcomes": [{**CAME[0], "outcome": "luck"}] * 30}, "outcomes[0].outcome"),
        ("pick", {"outcomes": [*CAME, {**CAME[0], "contact": 0.9}]}, "outcomes[30].contact"),
        ("reach", {"outcomes": CAME}, "checkpoint"),
    ],
)
def test_recalibration_that_cannot_be_is_refused(
    client: TestClient, reference: str, change: dict[str, Any], field: str
) -> None:
    answer = client.post(f"/v1/checkpoints/{reference}/recalibration", json=change)
    assert (answer.status_code, answer.json()["field"]) == (422, field)


def test_recalibration_accepts_the_rounding_of_a_sum_of_one(client: TestClient) -> None:
    outcomes = [{**CAME[0], "contact": 0.1 + 5e-7}] * 30
    answer = client.post("/v1/checkpoints/pick/recalibration", json={"outcomes": outcomes})
    assert answer.status_code in (200, 201), answer.text
