"""Jobs: submit, read, cancel.

    queued ──claim──> running ──> succeeded | failed
      │ ^               │  └──cancel──> cancelling ──> cancelled
      │ └──crash, restart of the server──┘
      │ └──resume── failed | cancelled
      └──cancel──> cancelled

Writes of workers and of the supervisor are in ``app.store.attempts`` and ``.completion``,
actions on ended jobs in ``.job_actions``.
"""

import uuid
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any, get_args

import sqlalchemy as sa

from app.digests import digest, has_digest
from app.errors import Conflict, InvalidInput, NotFound, WrongState
from app.store.cursors import read_page
from app.store.database.reserve import write_with_reserve
from app.store.database.tables import jobs
from app.store.engine import Store
from app.store.events import append_event
from app.store.records import FINAL_STATES, JobRecord, JobState, NewJob, Page, References
from app.store.references import named_checkpoint, require_stored

MAX_KEY_LENGTH = 255
"""Longest idempotency key."""
NOTHING = References()
"""A job that refers to nothing that can be deleted."""
NO_PARTS = "none"
"""Selects the jobs that are part of no other job."""
DERIVED = frozenset({"preset", "seed", "overrides", "total_steps"})
"""Members of a new job that follow from its spec; an update of Tandem may change them."""


def create_job(
    store: Store,
    new: NewJob,
    *,
    idempotency_key: str | None = None,
    references: References = NOTHING,
    submitted: Mapping[str, Any] | None = None,
) -> JobRecord:
    """Queue a job; the same key with the same submission returns the existing job.

    Args:
        idempotency_key: Identifies this submission.
        references: What must be stored.
        submitted: JSON data that repetitions of the submission have in common; None: spec,
            labels and budgets of the job.

    Raises:
        Conflict: The key was used for another submission.
        NotFound: The parent, or the job that it is part of, was deleted.
        WrongState: An equal repetition of its parent has not ended, or the job that it is part
            of has.
        InvalidInput: The key is empty or too long, or a reference is not stored.
        StorageFull: No room is left.
    """
    key: dict[str, str] = {}
    if idempotency_key is not None:
        key = _key_of(new, idempotency_key, submitted)
    with store.writing() as connection:
        if key and (earlier := _submitted_before(connection, new, key)) is not None:
            return earlier
        require_stored(connection, references)
        return _insert(connection, new, key)


def find_submission(
    store: Store,
    new: NewJob,
    idempotency_key: str,
    submitted: Mapping[str, Any] | None = None,
) -> JobRecord | None:
    """Return the job that the same submission has queued; None before it was queued.

    Args:
        idempotency_key, submitted: As for :func:`create_job`.

    Raises:
        Conflict: The key was used for another submission.
        InvalidInput: The key is empty or too long.
    """
    key = _key_of(new, idempotency_key, submitted)
    with store.reading() as connection:
        return _submitted_before(connection, new, key)


def find_repetition(
    store: Store, idempotency_key: str, submitted: Mapping[str, Any]
) -> JobRecord | None:
    """Return the job that the same action on another job, even a deleted one, has queued.

    Args:
        idempotency_key, submitted: As for :func:`create_job`.

    Returns:
        The job; None before it was queued, and where it was queued without a digest.

    Raises:
        Conflict: The key was used for another submission.
    """
    with store.reading() as connection:
        earlier = _job_of_key(connection, idempotency_key)
    if earlier is None or earlier.submission_digest is None:
        return None
    _require_same(earlier, same=has_digest(earlier.submission_digest, submitted))
    return earlier


def get_job(store: Store, job_id: str) -> JobRecord:
    """Return one job.

    Raises:
        NotFound: There is no such job.
    """
    with store.reading() as connection:
        return read_job(connection, job_id)


def find_job(store: Store, job_id: str) -> JobRecord | None:
    """Return one job; None where it was deleted."""
    with store.reading() as connection:
        return next(iter(select_jobs(connection, jobs.c.id == job_id)), None)


def list_jobs(
    store: Store,
    *,
    cursor: str | None = None,
    limit: int = 50,
    state: JobState | None = None,
    part_of: str | None = None,
    kind: str | None = None,
    preset: str | None = None,
) -> Page[JobRecord]:
    """Return one page of the jobs, newest first.

    Args:
        cursor: ``next_cursor`` of the page before; None for the first.
        limit: Length of the page, 1 to 200.
        state: Only jobs in this state.
        part_of: Only parts of the job with this id; ``NO_PARTS``: no parts of other jobs.
        kind: Only jobs of this kind.
        preset: Only trainings and sweeps of this preset.

    Raises:
        InvalidInput: The cursor or limit is invalid.
    """
    where = [] if state is None else [_in_state(state)]
    if part_of is not None:
        where.append(jobs.c.part_of == (None if part_of == NO_PARTS else part_of))
    for column, value in ((jobs.c.kind, kind), (jobs.c.preset, preset)):
        if value is not None:
            where.append(column == value)
    return _page(store, cursor, limit, where)


def list_evaluations(
    store: Store,
    *,
    protocol: str | None = None,
    checkpoint: str | None = None,
    cursor: str | None = None,
    limit: int = 50,
) -> Page[JobRecord]:
    """Return one page of the succeeded evaluations, newest first.

    Args:
        protocol: Only of this protocol.
        checkpoint: Only of the checkpoint with this SHA-256.
        cursor, limit: As for :func:`list_jobs`.

    Raises:
        InvalidInput: The cursor or limit is invalid.
    """
    where = [jobs.c.state == "succeeded", jobs.c.kind == "evaluate", jobs.c.result.is_not(None)]
    result: sa.ColumnElement[Any] = jobs.c.result
    if store.sqlite_path is not None:  # which ends a query at text that is no JSON
        result = sa.case((sa.func.json_valid(result) == 1, result))
    for name, value in (("protocol", protocol), ("checkpoint", checkpoint)):
        if value is not None:
            where.append(result[name].as_string() == value)
    return _page(store, cursor, limit, where)


def _page(
    store: Store, cursor: str | None, limit: int, where: Sequence[sa.ColumnElement[bool]]
) -> Page[JobRecord]:
    """Return one page of the jobs that meet all conditions, newest first."""
    query = sa.select(jobs).where(*where)
    with store.reading() as connection:
        rows, more = read_page(connection, query, jobs.c.number, cursor, limit)
    return Page(items=tuple(_record(row) for row in rows), next_cursor=more)


def count_jobs(store: Store) -> dict[JobState, int]:
    """Return the number of jobs in each state, 0 included."""
    query = sa.select(jobs.c.state, jobs.c.cancel_requested, sa.func.count())
    with store.reading() as connection:
        rows = connection.execute(query.group_by(jobs.c.state, jobs.c.cancel_requested)).all()
    found = dict.fromkeys(get_args(JobState), 0)
    for state, cancel, n in rows:
        found["cancelling" if state == "running" and cancel else state] += n
    return found


def job_ids(store: Store) -> frozenset[str]:
    """Return the ids of all jobs."""
    with store.reading() as connection:
        return frozenset(connection.execute(sa.select(jobs.c.id)).scalars())


def request_cancel(store: Store, job_id: str) -> JobRecord:
    """Cancel a queued job at once; request the stop of a running one.

    Raises:
        NotFound: There is no such job.
        Conflict: The job has succeeded or failed.
        StorageFull: No room is left.
    """

    def cancel(connection: sa.Connection) -> JobRecord:
        job = read_job(connection, job_id)
        if job.state in ("succeeded", "failed"):
            rule = f"is final: job {job.number} has ended and cannot be cancelled"
            raise WrongState("state", job.state, rule, ("queued", "running"))
        if job.state in ("queued", "running"):
            _cancel(connection, job)
        return read_job(connection, job_id)

    return write_with_reserve(store, cancel)


def read_job(connection: sa.Connection, job_id: str) -> JobRecord:
    """Return one job in a transaction.

    Raises:
        NotFound: There is no such job.
    """
    row = connection.execute(sa.select(jobs).where(jobs.c.id == job_id)).mappings().first()
    if row is None:
        raise NotFound("job", job_id)
    return _record(row)


def select_jobs(
    connection: sa.Connection, *conditions: sa.ColumnElement[bool]
) -> list[JobRecord]:
    """Return the jobs that meet all conditions, in a transaction, oldest first."""
    query = sa.select(jobs).where(*conditions).order_by(jobs.c.number)
    return [_record(row) for row in connection.execute(query).mappings()]


def cancel_parts(connection: sa.Connection, job_id: str) -> None:
    """Cancel the parts of a job that have not ended, in a transaction."""
    is_open = jobs.c.state.not_in(FINAL_STATES)
    for part in select_jobs(connection, jobs.c.part_of == job_id, is_open):
        if part.state != "cancelling":
            _cancel(connection, part)


def ended_now() -> dict[str, Any]:
    """Return the columns of a job that ends: the time, and the next number of an end.

    The clock may step back.
    """
    other = jobs.alias()
    last = sa.select(sa.func.coalesce(sa.func.max(other.c.end_number), 0)).scalar_subquery()
    return {"finished_at": datetime.now(UTC), "end_number": last + 1}


def _record(row: Mapping[Any, Any]) -> JobRecord:
    fields = dict(row)
    if fields["state"] == "running" and fields["cancel_requested"]:
        fields["state"] = "cancelling"
    return JobRecord(**fields)


def _members(new: NewJob) -> dict[str, Any]:
    """Return what was submitted for a new job; absent members and null are the same."""
    members = {**asdict(new), "spec": dict(new.spec)}
    return {
        name: value
        for name, value in members.items()
        if name not in DERIVED and value is not None
    }


def _key_of(
    new: NewJob, idempotency_key: str, submitted: Mapping[str, Any] | None
) -> dict[str, str]:
    """Return the columns of a job that identify its submission."""
    if not 1 <= len(idempotency_key) <= MAX_KEY_LENGTH:
        rule = f"must have 1 to {MAX_KEY_LENGTH} characters"
        raise InvalidInput("idempotency_key", idempotency_key, rule)
    submission = digest(_members(new) if submitted is None else submitted)
    return {"idempotency_key": idempotency_key, "submission_digest": submission}


def _submitted_before(
    connection: sa.Connection, new: NewJob, key: Mapping[str, str]
) -> JobRecord | None:
    """Return the job with the key of a submission; refuse another submission under it."""
    earlier = _job_of_key(connection, key["idempotency_key"])
    if earlier is not None:
        same = earlier.submission_digest == key["submission_digest"]
        if earlier.submission_digest is None:  # a job queued before migration 0015
            same = dict(earlier.spec) == dict(new.spec)
        _require_same(earlier, same=same)
    return earlier


def _job_of_key(connection: sa.Connection, idempotency_key: str) -> JobRecord | None:
    same_key = jobs.c.idempotency_key == idempotency_key
    return next(iter(select_jobs(connection, same_key)), None)


def _insert(connection: sa.Connection, new: NewJob, key: Mapping[str, str]) -> JobRecord:
    """Insert a queued job with its first event; ``key``: its key, and digest, if it has one."""
    if new.parent is not None:
        _check_single(connection, new)
    if new.part_of is not None:
        _check_open(connection, new.part_of)
    values = {
        **asdict(new),
        "id": str(uuid.uuid4()),
        "overrides": dict(new.overrides or {}),
        "spec": dict(new.spec),
        "checkpoint": named_checkpoint(connection, new.spec.get("checkpoint")),
        "state": "queued",
        "created_at": datetime.now(UTC),
        "last_event": 1,
        **key,
    }
    connection.execute(sa.insert(jobs).values(values))
    data = {"state": "queued", "attempt": 0}
    append_event(connection, str(values["id"]), 1, "state", data=data)
    return read_job(connection, str(values["id"]))


def _check_single(connection: sa.Connection, new: NewJob) -> None:
    """Refuse a second repetition of a job while an equal one waits or runs."""
    read_job(connection, str(new.parent))  # which may be deleted
    active = jobs.c.state.in_(("queued", "running"))
    named = named_checkpoint(connection, new.spec.get("checkpoint"))
    values = (dict(new.spec), named, new.step_budget, new.time_budget_s)
    for equal in select_jobs(connection, jobs.c.parent == new.parent, active):
        budgets = (equal.step_budget, equal.time_budget_s)
        if (dict(equal.spec), equal.checkpoint, *budgets) == values:
            rule = (
                f"of job {equal.number}, which repeats the same job with the same values: wait "
                "for it, or cancel it first"
            )
            raise WrongState("state", equal.state, rule, FINAL_STATES)


def _check_open(connection: sa.Connection, whole_id: str) -> None:
    """Refuse a part of a job that was cancelled or deleted since it was read."""
    whole = read_job(connection, whole_id)
    if whole.is_final:
        rule = f"is final: {whole.kind} {whole.number} has ended and starts no more jobs"
        raise WrongState("state", whole.state, rule, ("queued", "running"))


def _cancel(connection: sa.Connection, job: JobRecord) -> None:
    queued = job.state == "queued"
    changes: dict[str, Any] = {"cancel_requested": True, "last_event": job.last_event + 1}
    if queued:
        changes |= {"state": "cancelled", **ended_now()}
        cancel_parts(connection, job.id)  # resumed parts of one that is resumed, too
    connection.execute(sa.update(jobs).where(jobs.c.id == job.id).values(changes))
    data = {"state": "cancelled" if queued else "cancelling", "attempt": job.attempt}
    append_event(connection, job.id, job.last_event + 1, "state", data=data)


def _require_same(earlier: JobRecord, *, same: bool) -> None:
    """Refuse another submission under the key of an earlier one."""
    if not same:
        raise Conflict(
            f"idempotency key {earlier.idempotency_key!r} belongs to job {earlier.id}, which "
            "was submitted with another body: use a new key"
        )


def _in_state(state: JobState) -> sa.ColumnElement[bool]:
    if state == "cancelling":
        return sa.and_(jobs.c.state == "running", jobs.c.cancel_requested)
    if state == "running":
        return sa.and_(jobs.c.state == "running", sa.not_(jobs.c.cancel_requested))
    return jobs.c.state == state
