"""The step of a training whose attempt ended between two points of its curve."""

from collections.abc import Callable

import pytest

from app.store import attempts, completion, composed_jobs, job_actions, jobs, metrics
from app.store.engine import Store
from app.store.records import Claim, JobRecord
from tests.store.test_attempts import policy, record, resume
from tests.support.databases import claimed

RESULT = {"checkpoint": "ab" * 32, "step": 128}

ENDS: dict[str, Callable[[Store, Claim], object]] = {
    "succeeded": lambda store, claim: completion.finish(store, claim, result=RESULT),
    "step budget": lambda store, claim: completion.finish(
        store, claim, result=RESULT, ended_by="step budget"
    ),
    "time budget": lambda store, claim: completion.finish(
        store, claim, result=RESULT, ended_by="time budget"
    ),
    "cancelled": lambda store, claim: completion.finish(
        store, claim, state="cancelled", result=RESULT
    ),
    "cancelled, without a result": lambda store, claim: completion.finish(
        store, claim, state="cancelled"
    ),
    "failed": lambda store, claim: completion.fail(store, claim, "out of memory"),
    "failed by crashes": lambda store, claim: completion.crash(
        store, claim, "crash", max_failures=1
    ),
    "queued after a crash": lambda store, claim: completion.crash(
        store, claim, "crash", max_failures=3
    ),
    "interrupted": completion.give_back,
    "killed": lambda store, claim: completion.requeue_orphans(store),
    "pruned": lambda store, claim: prune(store, claim),
    "cancelled, then crashed": lambda store, claim: cancel_and_crash(store, claim),
    "cancelled, then killed": lambda store, claim: cancel_and_kill(store, claim),
}


def prune(store: Store, claim: Claim) -> None:
    composed_jobs.mark_pruned(store, claim.job_id)
    jobs.request_cancel(store, claim.job_id)
    completion.finish(store, claim, state="cancelled", result=RESULT)


def cancel_and_crash(store: Store, claim: Claim) -> None:
    jobs.request_cancel(store, claim.job_id)
    completion.crash(store, claim, "crash", max_failures=3)


def cancel_and_kill(store: Store, claim: Claim) -> None:
    jobs.request_cancel(store, claim.job_id)
    completion.requeue_orphans(store)


def save(store: Store, claim: Claim, step: int) -> None:
    attempts.record_checkpoint(store, claim, step, policy(bytes(step)), resume(step))


def ended(store: Store, claim: Claim, end: str) -> JobRecord:
    ENDS[end](store, claim)
    return jobs.get_job(store, claim.job_id)


@pytest.mark.parametrize("points", [(), (50, 100), (64, 128)], ids=str)
@pytest.mark.parametrize("end", ENDS)
def test_step_is_that_of_the_last_checkpoint_and_the_curve_stays(
    store: Store, claim: Claim, end: str, points: tuple[int, ...]
) -> None:
    record(store, claim, *points)
    save(store, claim, 128)
    assert ended(store, claim, end).step == 128
    assert [one.step for one in metrics.list_metrics(store, claim.job_id)] == list(points)
    newest = metrics.newest_point(store, claim.job_id)
    assert (newest and newest.step) == (points[-1] if points else None)


@pytest.mark.parametrize("end", ENDS)
def test_step_of_a_point_beyond_the_last_checkpoint_stays(
    store: Store, claim: Claim, end: str
) -> None:
    save(store, claim, 128)
    record(store, claim, 150)
    assert ended(store, claim, end).step == 150


def test_step_is_that_of_the_result_where_no_checkpoint_is_stored(
    store: Store, claim: Claim
) -> None:
    assert ended(store, claim, "time budget").step == 128


@pytest.mark.parametrize(
    "result", [{"value": 3}, {"step": None}, {"step": "9"}, {"step": True}]
)
def test_result_without_a_step_leaves_it(
    store: Store, claim: Claim, result: dict[str, object]
) -> None:
    record(store, claim, 1)
    completion.finish(store, claim, result=result)
    assert jobs.get_job(store, claim.job_id).step == 1


def test_training_that_its_time_budget_ended_goes_on_from_its_step(
    store: Store, claim: Claim
) -> None:
    record(store, claim, 100)
    save(store, claim, 128)
    assert ended(store, claim, "time budget").step == 128
    assert job_actions.resume_job(store, claim.job_id).step == 128
    again, job = claimed(store)
    assert job.step == 128
    record(store, again, 150)
    assert [one.step for one in metrics.list_metrics(store, job.id)] == [100, 150]
