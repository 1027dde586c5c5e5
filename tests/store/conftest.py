import pytest

from app.store import attempts, jobs
from app.store.engine import Store
from app.store.records import Claim, NewJob
from tests.support.databases import database_url, migrated, postgresql, store

__all__ = ["database_url", "migrated", "postgresql", "store"]


@pytest.fixture
def claim(store: Store) -> Claim:
    """A running job."""
    jobs.create_job(store, NewJob(kind="count", spec={"kind": "count"}))
    found = attempts.claim_next(store)
    assert found is not None
    return found[0]
