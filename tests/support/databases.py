"""Fixtures of databases: every test of a ``store`` runs on SQLite and on PostgreSQL."""

import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import sqlalchemy as sa

from app.store import attempts, jobs
from app.store.database.migrate import migrate
from app.store.engine import Store
from app.store.records import Claim, JobRecord, NewJob
from tests.support.postgresql_server import TEMPLATE, PostgresqlServer, postgresql_server

SQLITE_ONLY = pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)
POSTGRESQL = pytest.param("postgresql", marks=pytest.mark.postgres)
POSTGRESQL_ONLY = pytest.mark.parametrize("database_url", [POSTGRESQL], indirect=True)


@pytest.fixture(scope="session")
def migrated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An empty database with its tables; copying it is quicker than migrating again."""
    path = tmp_path_factory.mktemp("migrated") / "tandem.db"
    _migrate(f"sqlite:///{path}")
    return path


@pytest.fixture(scope="session")
def postgresql() -> Iterator[PostgresqlServer]:
    with postgresql_server() as server:
        server.execute(f"CREATE DATABASE {TEMPLATE}")
        _migrate(server.url(TEMPLATE))
        yield server


@pytest.fixture(params=["sqlite", POSTGRESQL])
def database_url(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    """An empty database with its tables."""
    if request.param == "sqlite":
        yield f"sqlite:///{shutil.copy(request.getfixturevalue('migrated'), tmp_path)}"
        return
    server: PostgresqlServer = request.getfixturevalue("postgresql")
    yield server.emptied_database()


@pytest.fixture
def store(database_url: str) -> Iterator[Store]:
    opened = Store(database_url)
    yield opened
    opened.close()


def started(store: Store) -> Claim:
    """Queue a job and claim it."""
    jobs.create_job(store, NewJob(kind="count", spec={"kind": "count"}))
    return claimed(store)[0]


def claimed(store: Store) -> tuple[Claim, JobRecord]:
    """Claim the next job, which must be there."""
    found = attempts.claim_next(store)
    assert found is not None
    return found


def wait_until_lease_expires(store: Store) -> None:
    """Wait for the time in the row of a PostgreSQL database, by its clock."""
    expired = sa.text("SELECT expires_at < clock_timestamp() AT TIME ZONE 'UTC' FROM leases")
    expires = True
    while expires:
        with store.reading() as connection:
            expires = not connection.execute(expired).scalar_one()
        time.sleep(0.02)


def _migrate(url: str) -> None:
    opened = Store(url)
    migrate(opened)
    opened.close()
