import pytest

from app.store.engine import Store
from app.store.records import Claim
from tests.support.databases import database_url, migrated, postgresql, started, store

__all__ = ["database_url", "migrated", "postgresql", "store"]


@pytest.fixture
def claim(store: Store) -> Claim:
    """A running job."""
    return started(store)
