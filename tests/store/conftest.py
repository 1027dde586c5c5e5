import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.store import attempts, jobs
from app.store.engine import Store
from app.store.migrate import migrate
from app.store.records import Claim, NewJob


@pytest.fixture(scope="session")
def migrated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An empty database with its tables; copying it is quicker than migrating again."""
    path = tmp_path_factory.mktemp("migrated") / "tandem.db"
    opened = Store(f"sqlite:///{path}")
    migrate(opened)
    opened.close()
    return path


@pytest.fixture
def store(tmp_path: Path, migrated: Path) -> Iterator[Store]:
    opened = Store(f"sqlite:///{shutil.copy(migrated, tmp_path)}")
    yield opened
    opened.close()


@pytest.fixture
def claim(store: Store) -> Claim:
    """A running job."""
    jobs.create_job(store, NewJob(kind="count", spec={"kind": "count"}))
    found = attempts.claim_next(store)
    assert found is not None
    return found[0]
