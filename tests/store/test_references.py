"""A job that is queued, and the delete of what it refers to, at once."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import product

import pytest
import sqlalchemy as sa

from app.errors import InvalidInput, NotFound, WrongState
from app.store import attempts, cells, checkpoints, completion, jobs, recordings, retention
from app.store.engine import Store
from app.store.records import NewJob, References
from app.store.references import references_of
from tests.store.test_attempts import policy
from tests.store.test_cells import KITCHEN
from tests.store.test_recordings import WAVE
from tests.store.test_retention import save
from tests.support.databases import claimed, started

WAIT_S = 30.0
Delete = Callable[[Store], object]


def uploaded(store: Store) -> tuple[References, Delete]:
    sha256 = checkpoints.put_checkpoint(store, policy(b"1")).sha256
    delete = partial(retention.delete_checkpoint, sha256=sha256, acting={})
    return References(checkpoint=sha256), delete


def alias(store: Store) -> tuple[References, Delete]:
    checkpoints.set_alias(store, "best", checkpoints.put_checkpoint(store, policy(b"1")).sha256)
    return References(checkpoint="best"), partial(checkpoints.remove_alias, name="best")


def trained(store: Store) -> tuple[References, Delete]:
    claim = started(store)
    sha256 = save(store, claim, 1, b"1")
    completion.finish(store, claim)
    delete = partial(retention.delete_job, job_id=claim.job_id, acting={})
    return References(checkpoint=sha256), delete


def cell(store: Store) -> tuple[References, Delete]:
    cells.put_cell(store, "kitchen", KITCHEN)
    return References(cell="kitchen"), partial(cells.remove_cell, name="kitchen")


def recording(store: Store) -> tuple[References, Delete]:
    recordings.put_recording(store, WAVE)
    return References(recordings=("wave",)), partial(recordings.remove_recording, name="wave")


def queue(store: Store, references: References) -> None:
    """Queue a job that refers to something."""
    spec = {"checkpoint": references.checkpoint, "recordings": list(references.recordings)}
    overrides = {"cell": references.cell}
    new = NewJob(kind="evaluate", spec=spec, overrides=overrides)
    assert references_of(new) == references
    jobs.create_job(store, new, references=references)


def at_once(store: Store, first: Delete, second: Delete) -> list[BaseException | None]:
    """Return the errors of two writes; the second begins while the first has the lock."""
    has_lock, go_on = threading.Event(), threading.Event()

    def hold(_connection: sa.Connection) -> None:
        has_lock.set()
        assert go_on.wait(WAIT_S)

    with ThreadPoolExecutor(2) as threads:
        writes = [threads.submit(first, store.fenced(hold))]
        assert has_lock.wait(WAIT_S)
        writes.append(threads.submit(second, store))
        time.sleep(0.2)
        assert not any(one.done() for one in writes)
        go_on.set()
        return [one.exception(WAIT_S) for one in writes]


@pytest.mark.parametrize(
    ("stored", "deletes_first"),
    [*product((uploaded, trained, cell, recording), (True, False)), (alias, True)],
)
def test_of_a_job_and_a_delete_at_once_the_later_one_is_refused(
    store: Store, stored: Callable[[Store], tuple[References, Delete]], deletes_first: bool
) -> None:
    references, delete = stored(store)
    known = jobs.count_jobs(store)["queued"]
    writes = [delete, partial(queue, references=references)]
    if not deletes_first:
        writes.reverse()
    done, refused = at_once(store, *writes)
    assert done is None, done
    assert isinstance(refused, InvalidInput if deletes_first else WrongState), refused
    assert jobs.count_jobs(store)["queued"] == known + (not deletes_first)


def test_job_refers_to_the_checkpoint_that_its_alias_named_when_it_was_queued(
    store: Store,
) -> None:
    references, remove = alias(store)
    sha256 = checkpoints.list_aliases(store)["best"]
    queue(store, references)
    other = checkpoints.put_checkpoint(store, policy(b"2")).sha256
    checkpoints.set_alias(store, "best", other)
    with pytest.raises(WrongState, match="is evaluated by job 1"):
        retention.delete_checkpoint(store, sha256, {})
    remove(store)
    retention.delete_checkpoint(store, other, {})
    (job,) = jobs.list_jobs(store).items
    assert (job.checkpoint, job.spec["checkpoint"]) == (sha256, "best")


def test_checkpoint_to_be_evaluated_stays_when_its_training_repeats_the_steps(
    store: Store,
) -> None:
    claim = started(store)
    first, second = save(store, claim, 1, b"1"), save(store, claim, 2, b"2")
    queue(store, References(checkpoint=second))
    completion.give_back(store, claim)
    claim = claimed(store)[0]
    attempts.resume_earlier(store, claim, None)
    assert checkpoints.read_checkpoint(store, second)[1] == b"2"
    with pytest.raises(NotFound):
        checkpoints.read_checkpoint(store, first)
    assert save(store, claim, 2, b"2") == second
    assert checkpoints.get_checkpoint(store, second).job_id == claim.job_id


@pytest.mark.parametrize("stored", [uploaded, alias, cell, recording])
def test_what_an_ended_job_refers_to_is_deleted(
    store: Store, stored: Callable[[Store], tuple[References, Delete]]
) -> None:
    references, delete = stored(store)
    queue(store, references)
    jobs.request_cancel(store, jobs.list_jobs(store).items[0].id)
    delete(store)
    with pytest.raises(InvalidInput, match="is no longer stored"):
        queue(store, references)
