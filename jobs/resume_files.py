"""Files that trainings need to resume: the transitions of their replay memories.

The database has the states, which list the files. ``resume/ID`` in the data folder belongs to
job ``ID``, until it has succeeded or is deleted. A folder of an unknown job may belong to
another database, such as the one that is set again after an error in the settings, or that is
restored later: it is kept for a while.
"""

import shutil
import time
from contextlib import suppress
from pathlib import Path

from app.store.attempts import has_resume
from app.store.engine import Store
from app.store.jobs import find_job

KEEP_UNKNOWN_S = 7 * 24 * 3600.0
"""Time for which the files of an unknown job are kept [s]."""
_MARK = "unknown-job"
"""Name of a file whose time is that of the first look at an unknown job."""
_UNFINISHED = ("*.unfinished", "*.part")
"""Names of files that a worker or a restoration has not finished, as patterns."""


def folder_of(data_dir: Path, job_id: str) -> Path:
    """Return the folder of a job's files."""
    return data_dir.absolute() / "resume" / job_id


def remove(folder: Path) -> None:
    """Delete the files of a job."""
    shutil.rmtree(folder, ignore_errors=True)


def remove_unneeded(store: Store, data_dir: Path) -> None:
    """Delete the files of jobs that have ended without a state to resume from.

    Those of unknown jobs are deleted ``KEEP_UNKNOWN_S`` after the first look at them, and
    unfinished files of ended jobs, which a killed worker or restoration has left, at once.
    Called by the thread that starts workers, so that no ended job is started meanwhile.
    """
    for folder in folder_of(data_dir, "").glob("*"):
        with suppress(OSError):  # one that cannot be changed keeps no other from its turn
            _remove_unneeded(store, folder)


def _remove_unneeded(store: Store, folder: Path) -> None:
    job = find_job(store, folder.name)
    if job is None:
        if is_long_unknown(folder / _MARK):
            remove(folder)
        return
    (folder / _MARK).unlink(missing_ok=True)
    if job.is_final and not has_resume(store, job.id):
        remove(folder)
    elif job.is_final:
        for left in (one for kind in _UNFINISHED for one in folder.glob(kind)):
            left.unlink()


def is_long_unknown(mark: Path) -> bool:
    """Whether ``KEEP_UNKNOWN_S`` has passed since the first look at files of an unknown job.

    Args:
        mark: A file whose time is that of this look, which makes it.
    """
    if not mark.exists():
        mark.touch()
    return time.time() - mark.stat().st_mtime > KEEP_UNKNOWN_S
