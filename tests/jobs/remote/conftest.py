from collections.abc import Iterator
from pathlib import Path

import pytest

from app.store.engine import Store
from tests.jobs.remote.serving import serving
from tests.support.databases import database_url, migrated, postgresql, store

__all__ = ["database_url", "migrated", "postgresql", "store"]


@pytest.fixture
def address(store: Store, tmp_path: Path) -> Iterator[str]:
    with serving(store, tmp_path) as (found, _):
        yield found
