from pathlib import Path

import pytest
import sqlalchemy as sa
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory

from app.errors import Conflict
from app.storage_errors import StorageDamaged
from app.store import jobs
from app.store.database.migrate import alembic_config, migrate
from app.store.database.schema import REVISION, check_schema
from app.store.database.tables import metadata
from app.store.engine import Store
from app.store.records import NewJob
from tests.support.postgresql_server import PostgresqlServer


def test_migrations_build_exactly_the_tables(store: Store) -> None:
    with store.reading() as connection:
        context = MigrationContext.configure(connection)
        assert compare_metadata(context, metadata) == []


def test_workers_ask_for_the_newest_migration() -> None:
    scripts = ScriptDirectory.from_config(alembic_config())
    assert scripts.get_current_head() == REVISION


def test_migrating_again_changes_nothing(store: Store) -> None:
    migrate(store)
    check_schema(store)


def test_migrations_can_be_taken_back(store: Store) -> None:
    config = alembic_config()
    with store.writing() as connection:
        config.attributes["connection"] = connection
        command.downgrade(config, "base")
        names = sa.inspect(connection).get_table_names()
    assert set(names) <= {"alembic_version", "sqlite_sequence"}


def test_jobs_that_ended_before_are_numbered_by_the_clock(store: Store) -> None:
    for _ in range(3):
        jobs.create_job(store, NewJob(kind="count", spec={}))
    second, first, _ = jobs.list_jobs(store).items
    for one in (first, second):
        jobs.request_cancel(store, one.id)
    config = alembic_config()
    with store.writing() as connection:
        config.attributes["connection"] = connection
        command.downgrade(config, "0013")
    migrate(store)
    found = {one.id: one.end_number for one in jobs.list_jobs(store).items}
    assert (found[first.id], found[second.id]) == (1, 2)
    assert sorted(map(str, found.values())) == ["1", "2", "None"]


def test_database_of_a_newer_version_is_refused(store: Store) -> None:
    with store.writing() as connection:
        connection.execute(sa.text("UPDATE alembic_version SET version_num = '9999'"))
    with pytest.raises(Conflict, match="has schema 9999, which this version of Tandem"):
        migrate(store)
    with pytest.raises(Conflict, match="has schema 9999, this code needs"):
        check_schema(store)


def test_worker_refuses_an_empty_database(tmp_path: Path) -> None:
    store = Store(f"sqlite:///{tmp_path}/empty.db")
    with pytest.raises(Conflict, match="has schema none"):
        check_schema(store)
    store.close()


def test_file_that_is_no_database_is_named(tmp_path: Path) -> None:
    (tmp_path / "tandem.db").write_text("these are my notes, not a database" * 100)
    store = Store(f"sqlite:///{tmp_path}/tandem.db")
    with pytest.raises(
        StorageDamaged, match=r"tandem\.db is damaged or no database \(file is not a"
    ):
        migrate(store)
    store.close()


@pytest.mark.postgres
def test_each_test_has_an_empty_database(postgresql: PostgresqlServer) -> None:
    """It has nothing of the test before, and has its indices no longer."""
    for _ in range(2):
        store = Store(postgresql.emptied_database())
        assert jobs.create_job(store, NewJob(kind="count", spec={})).number == 1
        with store.writing() as connection:
            assert compare_metadata(MigrationContext.configure(connection), metadata) == []
        store.close()
    store = Store(postgresql.emptied_database())
    with store.writing() as connection:
        connection.execute(sa.text("CREATE INDEX more ON jobs (kind)"))
    store.close()
    assert store.url != postgresql.emptied_database()
