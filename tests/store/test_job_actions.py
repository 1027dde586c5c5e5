from dataclasses import replace

import pytest

from app.errors import InvalidInput, NotFound, WrongState
from app.storage_errors import StaleAttempt
from app.store import attempts, checkpoints, completion, composed_jobs, job_actions, jobs
from app.store.engine import Store
from app.store.records import (
    Claim,
    JobRecord,
    NewCheckpoint,
    NewJob,
    References,
    ResumeState,
)
from tests.store.test_attempts import policy

COUNT = NewJob(kind="count", spec={"kind": "count"})


def save(store: Store, claim: Claim, step: int, made: NewCheckpoint) -> None:
    state = ResumeState(step=step, manifest={}, tensors=b"state")
    attempts.record_checkpoint(store, claim, step, made, state)


def end(store: Store, claim: Claim, state: str) -> JobRecord:
    if state == "failed":
        completion.fail(store, claim, "out of luck")
    elif state == "cancelled":
        completion.finish(store, claim, state="cancelled")
    elif state == "succeeded":
        completion.finish(store, claim)
    return jobs.get_job(store, claim.job_id)


@pytest.mark.parametrize("state", ["failed", "cancelled"])
def test_resumed_job_continues_from_its_newest_state(
    store: Store, claim: Claim, state: str
) -> None:
    save(store, claim, 10, policy(b"10"))
    attempts.record_progress(store, claim, 15, {"value": 1.0})
    end(store, claim, state)
    assert job_actions.resume_steps(store, [claim.job_id]) == {claim.job_id: 10}
    job = job_actions.resume_job(store, claim.job_id)
    assert (job.state, job.error, job.finished_at, job.failures) == ("queued", None, None, 0)
    found = attempts.claim_next(store)
    assert found is not None and found[1].step == 10 and found[0].attempt == 2
    resumed = attempts.load_resume(store, claim.job_id)
    assert resumed is not None and resumed.step == 10


def test_training_whose_cell_was_removed_is_not_resumed(store: Store, claim: Claim) -> None:
    save(store, claim, 10, policy(b"10"))
    end(store, claim, "cancelled")
    with pytest.raises(InvalidInput, match="overrides.cell = 'kitchen' is no longer stored"):
        job_actions.resume_job(store, claim.job_id, references=References(cell="kitchen"))
    assert jobs.get_job(store, claim.job_id).state == "cancelled"


def test_kills_before_a_resume_count_no_longer(store: Store, claim: Claim) -> None:
    save(store, claim, 10, policy(b"1"))
    for kill in range(completion.MAX_KILLS):
        if kill > 0:
            attempts.claim_next(store)
        completion.requeue_orphans(store)
    assert jobs.get_job(store, claim.job_id).state == "failed"
    assert job_actions.resume_job(store, claim.job_id).kills == 0
    attempts.claim_next(store)
    completion.requeue_orphans(store)
    job = jobs.get_job(store, claim.job_id)
    assert (job.state, job.kills) == ("queued", 1)


def test_second_click_on_resume_is_refused_with_the_state(store: Store, claim: Claim) -> None:
    save(store, claim, 10, policy(b"10"))
    end(store, claim, "failed")
    job_actions.resume_job(store, claim.job_id)
    with pytest.raises(WrongState, match="'queued' must be cancelled or failed to resume") as e:
        job_actions.resume_job(store, claim.job_id)
    assert e.value.problem()["choices"] == ["cancelled", "failed"]


def test_training_that_the_pruner_stops_is_not_resumed_before_its_end(
    store: Store, claim: Claim
) -> None:
    save(store, claim, 10, policy(b"10"))
    composed_jobs.mark_pruned(store, claim.job_id)
    jobs.request_cancel(store, claim.job_id)
    with pytest.raises(WrongState, match="'cancelling' must be cancelled or failed to resume"):
        job_actions.resume_job(store, claim.job_id)
    attempts.heartbeat(store, claim)
    end(store, claim, "cancelled")
    assert job_actions.resume_job(store, claim.job_id).state == "queued"


def test_succeeded_job_keeps_no_state_and_is_not_resumed(store: Store, claim: Claim) -> None:
    save(store, claim, 10, policy(b"10"))
    end(store, claim, "succeeded")
    assert job_actions.resume_steps(store, [claim.job_id]) == {}
    with pytest.raises(WrongState, match="clone it with changes"):
        job_actions.resume_job(store, claim.job_id)


def test_job_without_a_state_is_retried_instead_of_resumed(store: Store, claim: Claim) -> None:
    end(store, claim, "failed")
    with pytest.raises(WrongState, match="before its first checkpoint.*retry it"):
        job_actions.resume_job(store, claim.job_id)


def test_late_worker_of_a_resumed_job_is_fenced_off(store: Store, claim: Claim) -> None:
    save(store, claim, 10, policy(b"10"))
    end(store, claim, "cancelled")
    job_actions.resume_job(store, claim.job_id)
    with pytest.raises(StaleAttempt, match="no longer holds"):
        attempts.heartbeat(store, claim)


def test_equal_repetition_waits_for_the_first(store: Store, claim: Claim) -> None:
    end(store, claim, "failed")
    again = replace(COUNT, parent=claim.job_id)
    first = jobs.create_job(store, again)
    with pytest.raises(WrongState, match=f"of job {first.number}, which repeats"):
        jobs.create_job(store, again)
    jobs.create_job(store, replace(again, spec={"kind": "count", "seed": 2}))
    jobs.request_cancel(store, first.id)
    assert jobs.create_job(store, again).parent == claim.job_id


def test_repetitions_with_other_budgets_or_checkpoints_wait_for_none(
    store: Store, claim: Claim
) -> None:
    spec = {"kind": "evaluate", "checkpoint": "best"}
    again = replace(COUNT, parent=claim.job_id, spec=spec)
    for content in (b"1", b"2"):  # the alias is pointed to another checkpoint
        made = checkpoints.put_checkpoint(store, policy(content))
        checkpoints.set_alias(store, "best", made.sha256)
        jobs.create_job(store, again)
    for budget in ({"step_budget": 20}, {"step_budget": 40}, {"time_budget_s": 60.0}):
        jobs.create_job(store, replace(again, **budget))
    with pytest.raises(WrongState, match="which repeats"):
        jobs.create_job(store, replace(again, step_budget=40))


def test_repetition_of_an_unknown_job_is_refused(store: Store) -> None:
    with pytest.raises(NotFound):
        jobs.create_job(store, replace(COUNT, parent="gone"))


def test_jobs_of_higher_priority_start_first_the_older_of_equals(store: Store) -> None:
    low, old, new, late = (
        jobs.create_job(store, replace(COUNT, priority=p)).id for p in (0, 5, 5, -1)
    )
    job_actions.change_labels(store, late, {"priority": 9})
    order = []
    while (found := attempts.claim_next(store)) is not None:
        order.append(found[1].id)
    assert order == [late, old, new, low]


def test_labels_change_only_what_is_given(store: Store) -> None:
    job = jobs.create_job(store, replace(COUNT, name="first", notes="slow", priority=3))
    changed = job_actions.change_labels(store, job.id, {"notes": None})
    assert (changed.name, changed.notes, changed.priority) == ("first", None, 3)
    assert job_actions.change_labels(store, job.id, {}) == changed
    with pytest.raises(NotFound):
        job_actions.change_labels(store, "gone", {"name": "x"})
