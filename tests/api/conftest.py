"""One running service for the tests of this folder: real store, supervisor, policy and cell."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.api.services import Services
from app.main import create_app
from app.settings import Settings
from tests.api.described import Answered, api_document, undescribed
from tests.api.live_server import WARM_UP_S, served
from tests.support.databases import database_url, migrated, postgresql, store
from tests.support.waiting import wait_until

__all__ = ["database_url", "migrated", "postgresql", "store"]

ADDRESS = "http://127.0.0.1:8000"


def wait_until_ready(client: TestClient) -> None:
    """Wait for the kernels and the live cell."""
    wait_until(lambda: client.get("/readyz").is_success, within_s=WARM_UP_S)


@pytest.fixture(scope="package")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    app = create_app(Settings(data=tmp_path_factory.mktemp("data")))
    with TestClient(app, base_url=ADDRESS) as one:
        wait_until_ready(one)
        one.event_hooks = {"response": [require_description]}
        yield one


def services_of(client: TestClient) -> Services:
    """Return the parts of the service that a client asks."""
    return client.app.state.services  # type: ignore[attr-defined, no-any-return]


def require_description(answer: Answered) -> None:
    """Check an answer of a test: the OpenAPI document describes it."""
    fault = undescribed(api_document(), answer)
    assert fault is None, fault


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a server of the module's own."""
    with served(tmp_path_factory.mktemp("served")) as found:
        yield found


@pytest.fixture
def cold_app_settings(tmp_path: Path) -> Settings:
    return Settings(data=tmp_path / "data")


@pytest.fixture
def state(client: TestClient) -> dict[str, Any]:
    """The live world's state, as it can be posted, before the descent to an object."""
    now: dict[str, Any] = client.get("/v1/worlds/main").json()["state"]
    return now | {"phase": "approach", "closing_s": 0.0}
