from pathlib import Path

from app.api.state_metrics import stored_metrics
from app.store import attempts, jobs
from app.store.engine import Store
from app.store.records import NewJob
from tests.jobs.remote.serving import serving
from tests.support.databases import SQLITE_ONLY, database_url, migrated, postgresql, store

__all__ = ["database_url", "migrated", "postgresql", "store"]


@SQLITE_ONLY
def test_steps_of_every_running_job_are_read(store: Store, tmp_path: Path) -> None:
    n_jobs = 201  # more than the longest page
    for _ in range(n_jobs):
        jobs.create_job(store, NewJob(kind="count", spec={}, total_steps=5))
        attempts.claim_next(store)
    with serving(store, tmp_path) as (_, services):
        read = {one.name: one.samples for one in stored_metrics(services)}
    assert len(read["tandem_job_steps"]) == len(read["tandem_job_total_steps"]) == n_jobs
