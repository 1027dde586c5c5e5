import pytest

from app.store import jobs
from app.store.engine import Store
from app.store.records import Claim, NewJob
from tests.support.databases import claimed, database_url, migrated, postgresql, store

__all__ = ["database_url", "migrated", "postgresql", "store"]


@pytest.fixture
def claim(store: Store) -> Claim:
    """A running job."""
    jobs.create_job(store, NewJob(kind="count", spec={"kind": "count"}))
    return claimed(store)[0]
