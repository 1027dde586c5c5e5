from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import pytest

from app.digests import digest
from app.errors import InvalidInput
from app.storage_errors import StaleAttempt
from app.store import attempts, checkpoints, completion, events, fencing, jobs, metrics
from app.store.engine import Store
from app.store.records import Claim, NewCheckpoint, NewJob, ResumeState
from tests.support.databases import claimed


def policy(content: bytes = b"x") -> NewCheckpoint:
    manifest = {"n": len(content)}
    return NewCheckpoint(sha256=digest(manifest, content), manifest=manifest, tensors=content)


def resume(step: int, content: bytes = b"r") -> ResumeState:
    return ResumeState(step=step, manifest={"rng": [1, 2]}, tensors=content)


def record(store: Store, claim: Claim, *steps: int) -> None:
    for step in steps:
        attempts.record_progress(store, claim, step, {"reward": float(step)})


def curve(store: Store, claim: Claim) -> list[int]:
    return [row.step for row in metrics.list_metrics(store, claim.job_id)]


def claim_again(store: Store) -> Claim:
    completion.requeue_orphans(store)
    return claimed(store)[0]


def test_jobs_are_claimed_in_the_order_of_submission(store: Store) -> None:
    ids = [jobs.create_job(store, NewJob(kind="count", spec={})).id for _ in range(3)]
    claimed = [attempts.claim_next(store) for _ in range(4)]
    assert [found and found[0].job_id for found in claimed] == [*ids, None]


def test_one_job_is_claimed_by_one_of_many_threads(store: Store) -> None:
    jobs.create_job(store, NewJob(kind="count", spec={}))
    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(lambda _: attempts.claim_next(store), range(8)))
    assert sum(claim is not None for claim in found) == 1


def test_progress_reaches_job_and_curve(store: Store, claim: Claim) -> None:
    attempts.record_progress(store, claim, 10, {"success": 0.5, "reward": None}, total_steps=90)
    job = jobs.get_job(store, claim.job_id)
    (row,) = metrics.list_metrics(store, claim.job_id)
    assert (job.step, job.total_steps) == (10, 90)
    assert (row.step, row.values) == (10, {"success": 0.5, "reward": None})


@pytest.mark.parametrize("step", [10, 9])
def test_step_that_does_not_advance_is_refused(store: Store, claim: Claim, step: int) -> None:
    record(store, claim, 10)
    with pytest.raises(InvalidInput, match="must lie above the last recorded step 10"):
        attempts.record_progress(store, claim, step, {"success": 0.25})
    assert curve(store, claim) == [10]


def test_last_point_and_last_checkpoint_again_have_no_effect(
    store: Store, claim: Claim
) -> None:
    def write() -> list[bool]:
        attempts.record_progress(store, claim, 10, {"success": 0.1 + 0.2, "reward": None})
        states = resume(10), None
        return [attempts.record_checkpoint(store, claim, 10, policy(), s) for s in states]

    assert write() == [True, False]
    before = events.list_events(store, claim.job_id)
    assert write() == [False, False]
    assert events.list_events(store, claim.job_id) == before
    assert curve(store, claim) == [10] and attempts.load_resume(store, claim.job_id)


def test_nan_never_reaches_the_curve(store: Store, claim: Claim) -> None:
    with pytest.raises(InvalidInput, match="reward = nan must be finite"):
        attempts.record_progress(store, claim, 10, {"reward": float("nan")})
    assert curve(store, claim) == []


STALE_WRITES: dict[str, Callable[[Store, Claim], object]] = {
    "progress": lambda store, claim: record(store, claim, 99),
    "checkpoint": lambda store, claim: attempts.record_checkpoint(
        store, claim, 99, policy(), resume(99)
    ),
    "finish": lambda store, claim: completion.finish(store, claim, result={"stale": True}),
    "fail": lambda store, claim: completion.fail(store, claim, "stale"),
    "crash": lambda store, claim: completion.crash(store, claim, "stale", max_failures=3),
    "give back": lambda store, claim: completion.give_back(store, claim),
    "heartbeat": lambda store, claim: attempts.heartbeat(store, claim),
    "peek": lambda store, claim: fencing.peek(store, claim),
}


@pytest.mark.parametrize("write", STALE_WRITES.values(), ids=STALE_WRITES)
@pytest.mark.parametrize("ending", ["taken over", "ended", "queued"])
def test_stale_attempt_can_change_nothing(
    store: Store, claim: Claim, write: Callable[[Store, Claim], object], ending: str
) -> None:
    if ending == "taken over":
        claim_again(store)
    elif ending == "ended":
        completion.finish(store, claim)
    else:
        completion.give_back(store, claim)
    before = jobs.get_job(store, claim.job_id)
    with pytest.raises(StaleAttempt, match="attempt 1 no longer holds job"):
        write(store, claim)
    assert jobs.get_job(store, claim.job_id) == before
    assert curve(store, claim) == []
    assert attempts.load_resume(store, claim.job_id) is None
    assert checkpoints.list_checkpoints(store).items == ()


def test_new_attempt_drops_what_lies_beyond_the_last_checkpoint(
    store: Store, claim: Claim
) -> None:
    record(store, claim, 5, 10)
    attempts.record_checkpoint(store, claim, 12, policy(), resume(12))
    record(store, claim, 15, 20)
    second = claim_again(store)
    assert curve(store, claim) == [5, 10]
    assert jobs.get_job(store, claim.job_id).step == 12
    record(store, second, 15, 20, 25)
    assert curve(store, claim) == [5, 10, 15, 20, 25]


def test_new_attempt_without_checkpoint_starts_afresh(store: Store, claim: Claim) -> None:
    record(store, claim, 5, 10)
    attempts.record_checkpoint(store, claim, 10, policy())
    claim_again(store)
    assert curve(store, claim) == []
    assert checkpoints.list_checkpoints(store).items == ()
    assert jobs.get_job(store, claim.job_id).step == 0


def test_resume_state_is_replaced_by_each_checkpoint(store: Store, claim: Claim) -> None:
    attempts.record_checkpoint(store, claim, 10, policy(b"a"), resume(10, b"first"))
    attempts.record_checkpoint(store, claim, 20, policy(b"b"), resume(20, b"second"))
    assert attempts.load_resume(store, claim.job_id) == resume(20, b"second")


def test_attempt_may_start_from_an_earlier_state_than_its_claim(
    store: Store, claim: Claim
) -> None:
    for step in (10, 20):
        record(store, claim, step - 5, step)
        attempts.record_checkpoint(store, claim, step, policy(bytes([step])), resume(step))
    second = claim_again(store)
    assert jobs.get_job(store, claim.job_id).step == 20
    earlier = attempts.load_resume(store, claim.job_id, lambda state: state.step < 20)
    assert earlier == resume(10)
    attempts.resume_earlier(store, second, earlier.step)
    job, last = jobs.get_job(store, claim.job_id), events.list_events(store, claim.job_id)[-1]
    assert (job.state, job.step, curve(store, claim)) == ("running", 10, [5, 10])
    assert (last.kind, last.data["resumed_from_step"]) == ("state", 10)
    assert [c.step for c in checkpoints.list_checkpoints(store).items] == [10]
    attempts.resume_earlier(store, second, None)
    assert (curve(store, claim), attempts.has_resume(store, claim.job_id)) == ([], False)
    claim_again(store)
    with pytest.raises(StaleAttempt):
        attempts.resume_earlier(store, second, None)


@pytest.mark.parametrize("step", [10, None])
def test_delayed_start_changes_nothing(store: Store, claim: Claim, step: int | None) -> None:
    for at in (10, 20):
        attempts.record_checkpoint(store, claim, at, policy(bytes([at])), resume(at))
    second = claim_again(store)

    def written() -> tuple[object, ...]:
        stored = checkpoints.list_checkpoints(store, job_id=claim.job_id).items
        state = attempts.load_resume(store, claim.job_id)
        happened = events.list_events(store, claim.job_id)
        return curve(store, claim), stored, state, happened, jobs.get_job(store, claim.job_id)

    attempts.resume_earlier(store, second, step)
    before = written()
    attempts.resume_earlier(store, second, step)
    assert written() == before
    record(store, second, 15, 25)
    attempts.record_checkpoint(store, second, 30, policy(b"30"), resume(30))
    jobs.request_cancel(store, claim.job_id)
    before = written()
    attempts.resume_earlier(store, second, step)
    with pytest.raises(InvalidInput, match=f"step = 20 must equal {step or 0}, the start"):
        attempts.resume_earlier(store, second, 20)
    assert written() == before


def test_checkpoint_of_the_same_step_replaces_the_earlier(store: Store, claim: Claim) -> None:
    attempts.record_checkpoint(store, claim, 10, policy(b"a"), resume(10))
    attempts.record_checkpoint(store, claim, 20, policy(b"b"), resume(20))
    attempts.record_checkpoint(store, claim, 20, policy(b"c"), resume(20))
    kept = checkpoints.list_checkpoints(store).items
    assert [(c.step, c.sha256) for c in kept] == [
        (20, policy(b"c").sha256),
        (10, policy(b"a").sha256),
    ]


def test_start_does_not_depend_on_the_time_zone_of_the_database(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PGTZ", "Asia/Tokyo")
    with closing(Store(store.url)) as abroad:
        created = jobs.create_job(abroad, NewJob(kind="count", spec={}))
        claimed(abroad)
        job = jobs.get_job(abroad, created.id)
    assert job.started_at == job.heartbeat_at


def test_files_of_a_state_are_checked_outside_of_transactions(
    store: Store, claim: Claim
) -> None:
    """PostgreSQL ends a transaction that does nothing for 30 s."""
    for step in (1, 2):
        attempts.record_checkpoint(store, claim, step, policy(bytes([step])), resume(step))
    asked = []

    def usable(state: ResumeState) -> bool:
        asked.append((state.step, store.engine.pool.checkedout()))
        return state.step == 1

    assert attempts.load_resume(store, claim.job_id, usable) == resume(1)
    assert asked == [(2, 0), (1, 0)]


def test_resume_state_goes_when_the_job_ends(store: Store, claim: Claim) -> None:
    attempts.record_checkpoint(store, claim, 10, policy(), resume(10))
    completion.finish(store, claim, result={"success": 0.9})
    job = jobs.get_job(store, claim.job_id)
    assert attempts.load_resume(store, claim.job_id) is None
    assert (job.state, job.result) == ("succeeded", {"success": 0.9})


def test_checkpoint_and_resume_state_must_be_of_one_step(store: Store, claim: Claim) -> None:
    with pytest.raises(InvalidInput, match="must equal the checkpoint's 10"):
        attempts.record_checkpoint(store, claim, 10, policy(), resume(11))


def test_death_of_the_server_is_no_failure_of_the_job(store: Store, claim: Claim) -> None:
    for _ in range(10):
        claim = claim_again(store)
    job = jobs.get_job(store, claim.job_id)
    assert (job.state, job.attempt, job.failures) == ("running", 11, 0)


def test_job_fails_with_its_third_crash(store: Store, claim: Claim) -> None:
    for _ in range(2):
        assert completion.crash(store, claim, "boom", max_failures=3).state == "queued"
        claim = claim_again(store)
    job = completion.crash(store, claim, "boom: the last words", max_failures=3)
    assert (job.state, job.failures) == ("failed", 3) and job.error is not None
    assert "Failed after 3 attempts" in job.error and "the last words" in job.error


def test_success_after_a_crash_clears_the_error(store: Store, claim: Claim) -> None:
    completion.crash(store, claim, "boom", max_failures=3)
    claim = claim_again(store)
    completion.finish(store, claim)
    job = jobs.get_job(store, claim.job_id)
    assert (job.state, job.error, job.failures) == ("succeeded", None, 1)


@pytest.mark.parametrize("how", ["orphan", "crash", "give back"])
def test_job_to_be_cancelled_is_not_queued_again(store: Store, claim: Claim, how: str) -> None:
    attempts.record_checkpoint(store, claim, 10, policy(), resume(10))
    jobs.request_cancel(store, claim.job_id)
    if how == "orphan":
        completion.requeue_orphans(store)
    elif how == "crash":
        completion.crash(store, claim, "killed", max_failures=3)
    else:
        completion.give_back(store, claim)
    assert jobs.get_job(store, claim.job_id).state == "cancelled"
    assert attempts.load_resume(store, claim.job_id) == resume(10)


def test_events_follow_the_commits_without_gap_or_repetition(
    store: Store, claim: Claim
) -> None:
    record(store, claim, 5)
    attempts.record_checkpoint(store, claim, 5, policy(), resume(5))
    seen = events.list_events(store, claim.job_id)
    record(store, claim, 10)
    second = claim_again(store)
    record(store, second, 10)
    completion.finish(store, second)
    later = events.list_events(store, claim.job_id, after=seen[-1].id)
    kinds = [(e.kind, e.data.get("state", e.data.get("step"))) for e in (*seen, *later)]
    assert kinds == [
        ("state", "queued"),
        ("state", "running"),
        ("progress", 5),
        ("checkpoint", 5),
        ("state", "queued"),
        ("state", "running"),
        ("progress", 10),
        ("state", "succeeded"),
    ]
    ids = [event.id for event in (*seen, *later)]
    assert ids == sorted(set(ids))
    assert later[1].data["resumed_from_step"] == 5
    assert seen[2].data == {"step": 5, "reward": 5.0}


def test_reader_that_saw_dropped_progress_gets_it_again_under_new_ids(
    store: Store, claim: Claim
) -> None:
    record(store, claim, 5, 10)
    last = events.list_events(store, claim.job_id)[-1].id
    second = claim_again(store)
    record(store, second, 5)
    later = events.list_events(store, claim.job_id, after=last)
    assert [e.kind for e in later] == ["state", "state", "progress"]
    assert all(event.id > last for event in later)


def test_events_come_in_portions(store: Store, claim: Claim) -> None:
    record(store, claim, 1, 2, 3)
    first = events.list_events(store, claim.job_id, limit=3)
    rest = events.list_events(store, claim.job_id, after=first[-1].id, limit=3)
    assert [event.id for event in (*first, *rest)] == [1, 2, 3, 4, 5]


def test_worker_killed_after_a_cancel_cancels_its_job_at_the_last_failure_too(
    store: Store, claim: Claim
) -> None:
    completion.crash(store, claim, "killed", max_failures=2)
    found = claimed(store)
    jobs.request_cancel(store, claim.job_id)
    job = completion.crash(store, found[0], "killed by SIGTERM", max_failures=2)
    assert (job.state, job.error) == ("cancelled", None)


def test_result_with_a_number_that_is_not_finite_is_refused_by_its_place(
    store: Store, claim: Claim
) -> None:
    result = {"results": [{"name": "pick", "time_s": 1.0}, {"time_s": float("nan")}]}
    with pytest.raises(
        InvalidInput, match=r"result\.results\[1\]\.time_s = nan must be a finite"
    ):
        completion.finish(store, claim, result=result)
    assert jobs.get_job(store, claim.job_id).state == "running"
