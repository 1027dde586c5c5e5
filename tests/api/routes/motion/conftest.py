"""Policies that have learned nothing, in the store of the service."""

import pytest
from fastapi.testclient import TestClient

from app.policies.checkpoints.checkpoint import Checkpoint, pack
from jobs.checkpoints import to_store
from tests.api.conftest import services_of
from tests.api.routes.motion.motion_requests import BOX, GRID, JERK
from tests.policies.untrained import untrained_reach

RANGES = {
    "goal": {"low": [-0.5, 0.6, 0.1], "high": [0.5, 1.0, 0.5]},
    "human": {"low": [-2.0, 0.5, -1.0, -1.0, 0.2], "high": [1.0, 2.0, 1.0, 1.0, 0.5]},
}


def with_ranges(checkpoint: Checkpoint) -> Checkpoint:
    """The same, as if it had met certain values in training."""
    return pack({**checkpoint.manifest, "trained_range": RANGES}, checkpoint.arrays())


@pytest.fixture(scope="package")
def policies(client: TestClient) -> dict[str, str]:
    names = services_of(client).checkpoints
    made = {
        GRID: with_ranges(untrained_reach()),
        BOX: with_ranges(untrained_reach(goals="box")),
        JERK: untrained_reach(degree=3),
    }
    for alias, one in made.items():
        names.publish(alias, to_store(one))
    return {alias: one.sha256 for alias, one in made.items()}
