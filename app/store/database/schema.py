"""Check of the database's schema, for workers, which never change it."""

import sqlalchemy as sa

from app.errors import Conflict
from app.store.engine import Store

REVISION = "0016"
"""The newest migration."""


def check_schema(store: Store) -> None:
    """Check that the tables have this version, without changing them.

    Raises:
        Conflict: They have another version.
        StorageUnavailable: The database does not answer.
    """
    with store.reading() as connection:
        migrated = sa.inspect(connection).has_table("alembic_version")
        query = sa.text("SELECT version_num FROM alembic_version")
        present = connection.execute(query).scalar() if migrated else None
    if present != REVISION:
        raise Conflict(
            f"{store.shown_url} has schema {present or 'none'}, this code needs {REVISION}: "
            "start the server once, which upgrades it"
        )
