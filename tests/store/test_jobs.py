import pytest

from app.errors import Conflict, InvalidInput, NotFound
from app.store import attempts, completion, jobs
from app.store.engine import Store
from app.store.records import Claim, NewJob
from tests.support.databases import claimed


def queue(store: Store, n: int = 1) -> list[str]:
    return [jobs.create_job(store, NewJob(kind="count", spec={"i": i})).id for i in range(n)]


def test_created_job_is_queued_and_keeps_its_body_unchanged(store: Store) -> None:
    body = {"seed": 7, "kind": "count", "overrides": {"b": 1.5, "a": [1, "ä"]}}
    new = NewJob(kind="count", preset="p", seed=7, overrides=body["overrides"], spec=body)
    job = jobs.create_job(store, new)
    assert (job.state, job.attempt, job.seed, job.preset) == ("queued", 0, 7, "p")
    assert job.spec == body and list(job.spec) == list(body)
    assert job.created_at.utcoffset() is not None
    assert jobs.get_job(store, job.id) == job


def test_seed_beyond_32_bits_survives(store: Store) -> None:
    new = NewJob(kind="count", spec={}, seed=2**40)
    assert jobs.create_job(store, new).seed == 2**40


def test_same_key_and_body_is_the_same_job(store: Store) -> None:
    new = NewJob(kind="count", spec={"a": 1, "b": 2})
    reordered = NewJob(kind="count", spec={"b": 2, "a": 1})
    first = jobs.create_job(store, new, idempotency_key="k")
    assert jobs.create_job(store, reordered, idempotency_key="k").id == first.id
    assert len(jobs.list_jobs(store).items) == 1


def test_same_key_and_other_body_is_a_conflict(store: Store) -> None:
    jobs.create_job(store, NewJob(kind="count", spec={"a": 1}), idempotency_key="k")
    with pytest.raises(Conflict, match="'k' belongs to job"):
        jobs.create_job(store, NewJob(kind="count", spec={"a": 2}), idempotency_key="k")


@pytest.mark.parametrize("key", ["", "k" * 256])
def test_key_of_bad_length_is_refused(store: Store, key: str) -> None:
    with pytest.raises(InvalidInput, match="must have 1 to 255 characters"):
        jobs.create_job(store, NewJob(kind="count", spec={}), idempotency_key=key)


def test_unknown_job_is_not_found(store: Store) -> None:
    with pytest.raises(NotFound, match="no job 'x'"):
        jobs.get_job(store, "x")
    with pytest.raises(NotFound):
        jobs.request_cancel(store, "x")


def test_pages_show_every_job_once_newest_first(store: Store) -> None:
    ids = queue(store, 5)
    seen, cursor = [], None
    while True:
        page = jobs.list_jobs(store, cursor=cursor, limit=2)
        seen += [job.id for job in page.items]
        cursor = page.next_cursor
        if cursor is None:
            break
    assert seen == ids[::-1]


def test_page_is_not_disturbed_by_new_jobs(store: Store) -> None:
    ids = queue(store, 3)
    first = jobs.list_jobs(store, limit=2)
    queue(store, 2)
    second = jobs.list_jobs(store, cursor=first.next_cursor, limit=2)
    assert [job.id for job in second.items] == ids[:1]


@pytest.mark.parametrize("cursor", ["", "!", "äöü", "bm90IGEgbnVtYmVy"])
def test_foreign_cursor_is_refused(store: Store, cursor: str) -> None:
    with pytest.raises(InvalidInput, match="must be a cursor"):
        jobs.list_jobs(store, cursor=cursor)


@pytest.mark.parametrize("limit", [0, -1, 201])
def test_page_length_outside_its_limits_is_refused(store: Store, limit: int) -> None:
    with pytest.raises(InvalidInput, match=r"must lie in \[1, 200\]"):
        jobs.list_jobs(store, limit=limit)


def test_list_filters_by_state(store: Store, claim: Claim) -> None:
    queued = queue(store, 1)
    assert [j.id for j in jobs.list_jobs(store, state="queued").items] == queued
    assert [j.id for j in jobs.list_jobs(store, state="running").items] == [claim.job_id]
    jobs.request_cancel(store, claim.job_id)
    assert jobs.list_jobs(store, state="running").items == ()
    assert [j.id for j in jobs.list_jobs(store, state="cancelling").items] == [claim.job_id]


def test_list_shows_the_parts_of_a_job_or_leaves_parts_out(store: Store) -> None:
    whole, other = queue(store, 2)
    part = jobs.create_job(store, NewJob(kind="count", spec={}, part_of=whole, trial=1)).id
    assert [j.id for j in jobs.list_jobs(store, part_of=whole).items] == [part]
    assert [j.id for j in jobs.list_jobs(store, part_of="none").items] == [other, whole]
    assert jobs.list_jobs(store, part_of=other).items == ()


def test_list_filters_by_kind_and_preset_on_every_page(store: Store) -> None:
    kinds = [("train", "a"), ("sweep", "a"), ("train", "b"), ("train", "a"), ("report", None)]
    ids = [
        jobs.create_job(store, NewJob(kind=kind, preset=preset, spec={})).id
        for kind, preset in kinds
    ]
    reports = jobs.list_jobs(store, kind="report").items
    assert [one.id for one in reports] == ids[4:]
    of_preset = jobs.list_jobs(store, preset="a", limit=1)
    assert [one.id for one in of_preset.items] == [ids[3]]
    older = jobs.list_jobs(store, preset="a", kind="train", cursor=of_preset.next_cursor)
    assert ([one.id for one in older.items], older.next_cursor) == ([ids[0]], None)


def test_queued_job_is_cancelled_at_once(store: Store) -> None:
    (job_id,) = queue(store)
    job = jobs.request_cancel(store, job_id)
    assert job.state == "cancelled" and job.finished_at is not None
    assert attempts.claim_next(store) is None


def test_running_job_is_asked_to_stop(store: Store, claim: Claim) -> None:
    assert jobs.request_cancel(store, claim.job_id).state == "cancelling"
    assert attempts.heartbeat(store, claim).cancel_requested


def test_cancelling_twice_changes_nothing(store: Store) -> None:
    (job_id,) = queue(store)
    assert jobs.request_cancel(store, job_id) == jobs.request_cancel(store, job_id)


def test_finished_job_cannot_be_cancelled(store: Store, claim: Claim) -> None:
    completion.finish(store, claim)
    with pytest.raises(Conflict, match="'succeeded' is final: job 1"):
        jobs.request_cancel(store, claim.job_id)


def test_succeeded_evaluations_are_selected_by_protocol_and_checkpoint(store: Store) -> None:
    made = []
    for protocol, checkpoint in (("a", "1"), ("b", "1"), ("b", "2")):
        jobs.create_job(store, NewJob(kind="evaluate", spec={"protocol": protocol}))
        found = claimed(store)
        result = {"protocol": protocol, "checkpoint": checkpoint}
        completion.finish(store, found[0], result=result)
        made.append(found[0].job_id)
    queue(store, 1)

    def listed(**query: str) -> list[str]:
        return [job.id for job in jobs.list_evaluations(store, **query).items]

    assert listed() == made[::-1]
    assert listed(protocol="b") == made[:0:-1]
    assert listed(protocol="b", checkpoint="1") == [made[1]]
    assert listed(checkpoint="3") == []
