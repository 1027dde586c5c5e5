"""Files that trainings need to resume: the transitions of their replay memories.

The database has the states, which list the files. ``resume/ID`` in the data folder belongs to
job ``ID``, until it has succeeded or is deleted.
"""

import shutil
from pathlib import Path

from app.errors import NotFound
from app.store.attempts import has_resume
from app.store.engine import Store
from app.store.jobs import get_job


def folder_of(data_dir: Path, job_id: str) -> Path:
    """Return the folder of a job's files."""
    return data_dir.absolute() / "resume" / job_id


def remove(folder: Path) -> None:
    """Delete the files of a job."""
    shutil.rmtree(folder, ignore_errors=True)


def remove_unneeded(store: Store, data_dir: Path) -> None:
    """Delete the files of jobs that are gone, or have ended without a state to resume from."""
    for folder in folder_of(data_dir, "").glob("*"):
        try:
            job = get_job(store, folder.name)
        except NotFound:
            remove(folder)
            continue
        if job.is_final and not has_resume(store, job.id):
            remove(folder)
