"""Damaged checkpoints are never used, and errors name them."""

from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from safetensors.numpy import load

from app.cli.evaluate import find_checkpoint
from app.errors import Damaged
from app.main import create_app
from app.policies.checkpoints import pretrained
from app.policies.checkpoints.checkpoint import Checkpoint
from app.settings import Settings
from app.store.checkpoints import put_checkpoint, read_checkpoint, set_alias
from app.store.engine import Store
from jobs.checkpoints import to_store
from tests.api.conftest import ADDRESS, services_of, wait_until_ready
from tests.support.damage import JSON, TENSORS, Change, cut, damage, flip
from tests.support.waiting import wait_until

SEEDS = count(1000)
PLACES = {
    **{f"tensors: {name}": ("tensors", change) for name, change in TENSORS.items()},
    **{f"manifest: {name}": ("manifest", change) for name, change in JSON.items()},
}


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("damaged")


@pytest.fixture(scope="module")
def service(data: Path) -> Iterator[TestClient]:
    """A service that started with two damaged checkpoints: a shipped one and one of a user."""
    with TestClient(create_app(Settings(data=data)), base_url=ADDRESS) as first:
        wait_until_ready(first)
        assert first.get("/readyz").json()["status"] == "ready"
    store = Store(Settings(data=data).database)
    mine = keep(store, "mine")
    store.close()
    for sha256, change in ((pretrained.SHA256["pick"], cut), (mine, flip(-5))):
        damage(data / "tandem.db", "checkpoints", "tensors", f"sha256 = '{sha256}'", change)
    app = create_app(Settings(data=data))
    with TestClient(app, base_url=ADDRESS, raise_server_exceptions=False) as second:
        wait_until_ready(second)
        yield second


def keep(store: Store, alias: str, shipped: str = "pick") -> str:
    """Store a copy of a shipped policy as one of a user's own; return its SHA-256."""
    found = pretrained.load(shipped)
    made = Checkpoint({**found.manifest, "seed": next(SEEDS)}, found.tensors)
    put_checkpoint(store, to_store(made))
    set_alias(store, alias, made.sha256)
    return made.sha256


def state_of(service: TestClient) -> dict[str, Any]:
    state: dict[str, Any] = service.get("/v1/worlds/main").json()["state"]
    return {**state, "previous": None, "phase": "approach", "closing_s": 0.0}


def named(answer: Any, alias: str, sha256: str) -> bool:
    body = answer.json()
    return (answer.status_code, body["type"], body["name"], body["sha256"]) == (
        500,
        "urn:tandem:problem:damaged",
        alias,
        sha256,
    ) and "train it again" in body["detail"]


def test_start_heals_shipped_checkpoints_and_names_the_others(service: TestClient) -> None:
    ready = wait_until(
        lambda: service.get("/readyz").json(), lambda answer: answer["status"] != "ready"
    )
    assert ready == {"status": "degraded", "damaged": ["mine"]}
    assert service.get("/healthz").status_code == 200
    answer = service.post("/v1/task-selection", json=state_of(service))
    assert answer.json()["checkpoint"] == pretrained.SHA256["pick"]


@pytest.mark.parametrize(("column", "change"), PLACES.values(), ids=PLACES)
def test_every_reader_of_a_damaged_checkpoint_gets_an_error(
    service: TestClient, data: Path, column: str, change: Change
) -> None:
    store = services_of(service).store
    alias = f"mine-{next(SEEDS)}"
    sha256 = keep(store, alias)
    damage(data / "tandem.db", "checkpoints", column, f"sha256 = '{sha256}'", change)
    asked = {**state_of(service), "checkpoint": alias}
    assert named(service.post("/v1/task-selection", json=asked), alias, sha256)
    for path in ("", "/manifest", "/tensors"):
        assert named(service.get(f"/v1/checkpoints/{sha256}{path}"), alias, sha256)
    job = {"kind": "evaluate", "protocol": "pick-single", "checkpoint": alias, "episodes": 1}
    assert named(service.post("/v1/jobs", json=job), alias, sha256)
    shown = {"cell": "pick-and-place", "checkpoint": alias}
    assert named(service.put("/v1/worlds/main/cell", json=shown), alias, sha256)
    with pytest.raises(Damaged, match=alias):
        find_checkpoint(alias, Settings(data=data))
    listed = service.get("/v1/checkpoints", params={"limit": 200})
    assert sha256 in {one["sha256"] for one in listed.json()["items"]}
    assert alias in service.get("/readyz").json()["damaged"]
    assert service.post("/v1/task-selection", json=state_of(service)).status_code == 200


def test_deleted_checkpoint_is_named_as_damaged_no_longer(
    service: TestClient, data: Path
) -> None:
    sha256 = keep(service.app.state.services.store, "gone")  # type: ignore[attr-defined]
    damage(data / "tandem.db", "checkpoints", "tensors", f"sha256 = '{sha256}'", cut)
    asked = {**state_of(service), "checkpoint": "gone"}
    assert named(service.post("/v1/task-selection", json=asked), "gone", sha256)
    assert "gone" in service.get("/readyz").json()["damaged"]
    for path in ("/v1/aliases/gone", f"/v1/checkpoints/{sha256}"):
        assert service.delete(path).status_code == 204
    assert "gone" not in service.get("/readyz").json()["damaged"]


@pytest.mark.parametrize("alias", ["reach", "sorting-e0"])
def test_damaged_policies_of_other_kinds_are_not_loaded(
    service: TestClient, data: Path, alias: str
) -> None:
    services = services_of(service)
    registry = services.reach_policies if alias == "reach" else services.sorting_policies
    sha256 = keep(services.store, f"my-{alias}", alias)
    damage(data / "tandem.db", "checkpoints", "tensors", f"sha256 = '{sha256}'", flip(500))
    with pytest.raises(Damaged, match=f"my-{alias}"):
        registry.load(f"my-{alias}")


@pytest.mark.parametrize("alias", pretrained.ALIASES)
@pytest.mark.parametrize(("column", "change"), PLACES.values(), ids=PLACES)
def test_shipped_checkpoint_is_healed_where_it_is_read(
    service: TestClient, data: Path, alias: str, column: str, change: Change
) -> None:
    sha256 = pretrained.SHA256[alias]
    damage(data / "tandem.db", "checkpoints", column, f"sha256 = '{sha256}'", change)
    answer = service.get(f"/v1/checkpoints/{alias}/tensors")
    assert (answer.status_code, answer.headers["etag"]) == (200, f'"{sha256}"')
    assert load(answer.content)
    store = services_of(service).store
    assert read_checkpoint(store, alias)[1] == answer.content


def test_damaged_policies_are_passed_over_where_none_is_named(
    service: TestClient, data: Path
) -> None:
    store = services_of(service).store
    sha256 = keep(store, "newest")
    damage(data / "tandem.db", "checkpoints", "tensors", f"sha256 = '{sha256}'", flip(-5))
    shown = service.put("/v1/worlds/main/cell", json={"cell": "pick-and-place"})
    assert shown.status_code == 200
    assert service.get("/v1/worlds/main").json()["checkpoint"] == pretrained.SHA256["pick"]
