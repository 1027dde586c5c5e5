from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import pytest

from app.api.schemas.jobs import JobPublic
from app.store import attempts, jobs
from app.store.engine import Store
from app.store.records import JobRecord, MetricRow, NewJob
from tests.support.databases import database_url, migrated, postgresql, store

__all__ = ["database_url", "migrated", "postgresql", "store"]

POINT = MetricRow(step=25, values={"time_left_s": 75.0}, at=datetime.now(UTC))


@pytest.fixture
def running(store: Store) -> JobRecord:
    """A job that has done a quarter of its 100 steps."""
    jobs.create_job(store, NewJob(kind="train", spec={}, total_steps=100))
    found = attempts.claim_next(store)
    assert found is not None
    attempts.record_progress(store, found[0], 25, {"time_left_s": 75.0})
    return jobs.get_job(store, found[0].job_id)


@pytest.mark.parametrize(
    ("changes", "progress", "left"),
    [
        ({}, 0.25, 75.0),
        ({"step_budget": 50}, 0.5, 25.0),
        ({"step_budget": 20}, 1.0, 0.0),
        ({"step_budget": 400}, 0.25, 75.0),
        ({"time_budget_s": 40.0, "run_s": 30.0}, 0.75, 10.0),
        ({"time_budget_s": 400.0, "run_s": 30.0, "step_budget": 50}, 0.5, 25.0),
        ({"total_steps": None}, None, None),
        ({"state": "succeeded"}, 0.25, None),
    ],
)
def test_progress_and_time_left_follow_the_budget_that_ends_first(
    running: JobRecord, changes: dict[str, Any], progress: float | None, left: float | None
) -> None:
    shown = JobPublic.from_domain(replace(running, **changes), POINT)
    assert (shown.progress, shown.time_left_s) == (progress, left)
