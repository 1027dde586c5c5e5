from collections.abc import Iterator
from pathlib import Path

import pytest

from app.store import attempts, jobs
from app.store.engine import Store
from app.store.migrate import migrate
from app.store.records import Claim, NewJob


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    opened = Store(f"sqlite:///{tmp_path}/tandem.db")
    migrate(opened)
    yield opened
    opened.close()


@pytest.fixture
def claim(store: Store) -> Claim:
    """A running job."""
    jobs.create_job(store, NewJob(kind="count", spec={"kind": "count"}))
    found = attempts.claim_next(store)
    assert found is not None
    return found[0]
