"""A cell of the user's own through the whole service: stored, trained in, deciding, shown."""

import asyncio
from collections.abc import Iterator
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.api.schemas.examples import PLAN, RISK_MAP, TASK_SELECTION
from app.policies.training.train import train
from app.sim.cells.cell import Cell
from app.store.checkpoints import put_checkpoint
from jobs.checkpoints import to_store
from tests.api.conftest import services_of
from tests.policies.conftest import TINY, preset_of
from tests.support import workshop


@pytest.fixture(scope="module")
def checkpoint(client: TestClient) -> str:
    """A policy that was trained in the own cell, in the store of the service."""
    made = train(
        preset_of("pick-td3", TINY, {"learning.total_steps": 1024, "cell": "workshop"}),
        seed=2,
        on_progress=lambda _: None,
        on_checkpoint=lambda *_: None,
        should_stop=lambda: False,
        cell=workshop.cell(),
    ).checkpoint
    put_checkpoint(services_of(client).store, to_store(made))
    return made.sha256


@pytest.fixture
def own(client: TestClient) -> Iterator[None]:
    client.post("/v1/cells", json=workshop.definition()).raise_for_status()
    yield
    client.delete("/v1/cells/workshop")


def asked(state: dict[str, Any], checkpoint: str | None, cell: str) -> dict[str, Any]:
    candidates = [{"id": "part2", "position": [0.2, 0.62, 0.12]}]
    changes = {"cell": cell, "checkpoint": checkpoint, "candidates": candidates}
    return {**state, **changes, "previous": None}


@pytest.mark.usefixtures("own")
def test_policy_decides_in_its_own_cell_and_where_only_the_stations_differ(
    client: TestClient, state: dict[str, Any], checkpoint: str
) -> None:
    answer = client.post("/v1/task-selection", json=asked(state, checkpoint, "workshop"))
    assert answer.status_code == 200
    assert (answer.json()["chosen"], answer.json()["checkpoint"]) == ("part2", checkpoint)
    for reference, cell in ((checkpoint, "pick-and-place"), (None, "workshop")):
        other = client.post("/v1/task-selection", json=asked(state, reference, cell))
        assert (other.status_code, other.json()["chosen"]) == (200, "part2")


def is_on_event_loop() -> bool:
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return False
    return True


@pytest.mark.usefixtures("own")
@pytest.mark.parametrize(
    ("url", "body"),
    [
        ("/v1/task-selection", TASK_SELECTION),
        ("/v1/plan", PLAN),
        ("/v1/risk-map", RISK_MAP),
    ],
)
def test_cell_of_a_policy_is_not_read_on_the_event_loop(
    client: TestClient,
    checkpoint: str,
    monkeypatch: pytest.MonkeyPatch,
    url: str,
    body: dict[str, Any],
) -> None:
    catalog = services_of(client).cells
    get, on_loop = catalog.get, list[bool]()

    def watched(name: str) -> Cell:
        if name == "workshop":
            on_loop.append(is_on_event_loop())
        return get(name)

    monkeypatch.setattr(catalog, "get", watched)
    client.post(url, json={**body, "checkpoint": checkpoint})
    assert set(on_loop) == {False}


def test_policy_refuses_a_cell_with_another_robot(
    client: TestClient, state: dict[str, Any]
) -> None:
    other = workshop.definition(name="slow-workshop")
    other["robot"]["qd_max"] = [0.4] * 6
    client.post("/v1/cells", json=other).raise_for_status()
    refused = client.post("/v1/task-selection", json=asked(state, None, "slow-workshop"))
    client.delete("/v1/cells/slow-workshop")
    assert (refused.status_code, refused.json()["property"]) == (409, "cell")
    assert "pick-and-place, which has another robot" in refused.json()["detail"]


def test_unknown_cell_of_a_request_names_the_known(
    client: TestClient, state: dict[str, Any]
) -> None:
    answer = client.post("/v1/task-selection", json=asked(state, None, "garage"))
    assert answer.status_code == 422
    assert "pick-and-place" in answer.json()["choices"]


def test_policy_refuses_its_cell_once_that_has_changed(
    client: TestClient, state: dict[str, Any], checkpoint: str
) -> None:
    changed = workshop.definition(title="With another title")
    client.post("/v1/cells", json=changed).raise_for_status()
    answer = client.post("/v1/task-selection", json=asked(state, checkpoint, "workshop"))
    client.delete("/v1/cells/workshop")
    assert answer.status_code == 409
    assert "workshop as it is now" in answer.json()["detail"]


@pytest.mark.usefixtures("own")
def test_live_world_shows_the_own_cell_with_the_policy_trained_there(
    client: TestClient, checkpoint: str
) -> None:
    shown = client.put("/v1/worlds/main/cell", json={"cell": "workshop"})
    back = client.put("/v1/worlds/main/cell", json={"cell": "pick-and-place"})
    assert (shown.json()["cell"], shown.json()["checkpoint"]) == ("workshop", checkpoint)
    assert back.json()["cell"] == "pick-and-place"


def test_sweep_by_choices_is_refused_where_a_cell_has_too_few_stations(
    client: TestClient,
) -> None:
    small = workshop.definition(name="small-workshop")
    small["stations"] = small["stations"][-2:]
    client.post("/v1/cells", json=small).raise_for_status()
    sweep = {
        "kind": "sweep",
        "preset": "pick-td3",
        "overrides": {"cell": "small-workshop"},
        "ranges": {"learning.n_steps": {"low": 1, "high": 5}},
        "trials": 2,
        "objective": {"protocol": "pick-choice"},
    }
    refused = client.post("/v1/jobs", json=sweep)
    client.delete("/v1/cells/small-workshop")
    assert refused.status_code == 422, refused.json()
    assert refused.json()["field"] == "objective.protocol"
    assert "has 2 cubes and docks, of which 3 are needed" in refused.json()["detail"]
