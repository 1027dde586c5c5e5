"""Commands to the live world of the service, and waiting for what they change."""

from collections.abc import Callable
from typing import Any

from fastapi.testclient import TestClient

from tests.support.waiting import wait_until

WORLD = "/v1/worlds/main"
COMMANDS = f"{WORLD}/commands"


def send(client: TestClient, **command: Any) -> Any:
    return client.post(COMMANDS, json=command)


def until(
    client: TestClient, holds: Callable[[dict[str, Any]], object], within_s: float = 60.0
) -> dict[str, Any]:
    """Return the world's snapshot once it holds."""
    return wait_until(lambda: client.get(WORLD).json(), holds, within_s=within_s)
