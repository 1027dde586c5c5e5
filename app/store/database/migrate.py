"""Creation and upgrade of the tables."""

from pathlib import Path

import sqlalchemy as sa
from alembic import command
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory

from app.errors import Conflict
from app.store.database.lease import Lease
from app.store.engine import Store

_SCRIPTS = Path(__file__).parents[1] / "migrations"


def migrate(store: Store, lease: Lease | None = None) -> None:
    """Create or upgrade the tables, and take the lease in the same transaction.

    Args:
        lease: The lease of the server; its lock is held.

    Raises:
        Conflict: Another server holds the lease, or a newer version of Tandem wrote the
            database.
        StorageDamaged: The file is damaged, or no database.
        StorageUnavailable: It does not answer.
        StorageFull: No room is left.
    """
    with store.writing() as connection:
        if lease is not None:
            lease.refuse_if_held(connection)
        _upgrade(connection, store.shown_url)
        if lease is not None:
            lease.take(connection)


def alembic_config() -> Config:
    """Return Alembic's configuration."""
    config = Config()
    config.set_main_option("script_location", str(_SCRIPTS).replace("%", "%%"))
    return config


def _upgrade(connection: sa.Connection, shown_url: str) -> None:
    config = alembic_config()
    known = {script.revision for script in ScriptDirectory.from_config(config).walk_revisions()}
    present = _revision(connection)
    if present is not None and present not in known:
        raise Conflict(
            f"{shown_url} has schema {present}, which this version of Tandem does not know (it "
            f"knows {', '.join(sorted(known))}): start the newer version, or choose another "
            "TANDEM_DATA"
        )
    config.attributes["connection"] = connection
    command.upgrade(config, "head")


def _revision(connection: sa.Connection) -> str | None:
    return MigrationContext.configure(connection).get_current_revision()
