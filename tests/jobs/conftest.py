import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.store.engine import Store
from jobs.executor import LocalExecutor
from jobs.supervisor import Supervisor
from tests.jobs.machinery import supervised
from tests.jobs.supervisor_process import COUNTING
from tests.support.databases import database_url, migrated, postgresql, store
from tests.support.trainings import Made, made_undisturbed

__all__ = ["database_url", "migrated", "postgresql", "store"]


@pytest.fixture
def executor(store: Store, tmp_path: Path) -> LocalExecutor:
    return LocalExecutor(store.url, tmp_path, COUNTING)


@pytest.fixture
def supervisor(store: Store, tmp_path: Path, executor: LocalExecutor) -> Iterator[Supervisor]:
    """A supervisor that runs counting jobs."""
    with supervised(store, tmp_path, executor=executor) as started:
        yield started


@pytest.fixture(scope="session")
def undisturbed(migrated: Path, tmp_path_factory: pytest.TempPathFactory) -> Made:
    """What the training of ``trainings`` makes where nothing kills or stops it."""
    folder = tmp_path_factory.mktemp("undisturbed")
    one = Store(f"sqlite:///{shutil.copy(migrated, folder)}")
    made = made_undisturbed(one, folder)
    one.close()
    return made
