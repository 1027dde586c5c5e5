"""The database as verbs of the command line open it, beside a server or without one."""

from collections.abc import Iterator
from contextlib import contextmanager

from app.errors import Conflict, NotFound
from app.settings import Settings
from app.store.engine import Store
from app.store.lock import ServerLock
from app.store.migrate import migrate
from app.store.schema import check_schema


def has_database(settings: Settings) -> bool:
    """Whether there is a database, as far as that can be told without opening it."""
    return settings.database_url is not None or (settings.data / "tandem.db").exists()


@contextmanager
def opened(settings: Settings, noun: str, *, create: bool = False) -> Iterator[Store]:
    """Open the database, and close it again.

    Args:
        settings: Where it is.
        noun: What is looked for in it, such as ``"motion"``, for the message.
        create: Whether to make one that is not there yet, and to upgrade an older one.

    Raises:
        NotFound: There is no database.
        Conflict: It has the tables of another version.
    """
    if create:
        settings.data.mkdir(parents=True, exist_ok=True)
    elif not has_database(settings):
        raise NotFound(f"{noun}: there is no database at", settings.database)
    store = Store(settings.database)
    try:
        try:
            check_schema(store)
        except Conflict:
            if not create:
                raise
            lock = ServerLock(store, settings.data)
            lock.acquire()
            try:
                migrate(store)
            finally:
                lock.release()
        yield store
    finally:
        store.close()
