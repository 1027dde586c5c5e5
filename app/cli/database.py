"""The database as commands open it, beside a running server or without one."""

from collections.abc import Iterator
from contextlib import closing, contextmanager

from app.errors import Conflict, NotFound
from app.settings import Settings, make_data_folder
from app.store.database.lease import Lease
from app.store.database.lock import ServerLock
from app.store.database.migrate import migrate
from app.store.database.schema import check_schema
from app.store.engine import Store


def has_database(settings: Settings) -> bool:
    """Whether the file of the database exists; true for a database that is no file."""
    if settings.database_url is None:
        return (settings.data / "tandem.db").exists()
    path = Store(settings.database_url).sqlite_path
    return path is None or path.exists()


@contextmanager
def opened(settings: Settings, noun: str, *, create: bool = False) -> Iterator[Store]:
    """Open the database, and close it again.

    Args:
        noun: The object of the command, such as ``"recording"``, for the message.
        create: Whether to create a missing database and to upgrade an older one.

    Raises:
        NotFound: There is no database.
        Conflict: It has the tables of another version.
    """
    if create:
        make_data_folder(settings)
    elif not has_database(settings):
        raise NotFound(f"{noun}: there is no database at", settings.database)
    with closing(Store(settings.database)) as store:
        try:
            check_schema(store)
        except Conflict:
            if not create:
                raise
            upgrade(store, settings)
        yield store


def upgrade(store: Store, settings: Settings) -> None:
    """Create the tables, or bring them to this version.

    Raises:
        Conflict: A server uses the database.
    """
    lock = ServerLock(store, settings.data)
    lock.acquire()
    try:
        lease = Lease(store, lock)
        migrate(store, lease)
        lease.release()
    finally:
        lock.release()
