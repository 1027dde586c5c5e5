import pytest

from app.errors import InvalidInput, NotFound
from app.store import attempts, checkpoints, completion
from app.store.engine import Store
from app.store.records import Claim, NewCheckpoint, ResumeState
from tests.store.test_attempts import policy
from tests.support.databases import started


def test_checkpoint_of_a_job_is_found_by_its_hash(store: Store, claim: Claim) -> None:
    new = policy(bytes(range(256)))
    attempts.record_checkpoint(store, claim, 7, new)
    found = checkpoints.get_checkpoint(store, new.sha256)
    assert (found.job_id, found.step, found.size) == (claim.job_id, 7, 256)
    assert found.manifest == new.manifest != {}
    assert checkpoints.read_checkpoint(store, new.sha256) == (found, new.tensors)


def test_newest_checkpoint_of_a_job_may_be_as_old_as_another_job(
    store: Store, claim: Claim
) -> None:
    shared = policy(b"last")
    attempts.record_checkpoint(store, claim, 30, shared)
    again = started(store)
    for step, one in ((10, policy(b"first")), (20, policy(b"second")), (30, shared)):
        attempts.record_checkpoint(store, again, step, one)
    pages = [checkpoints.list_checkpoints(store, job_id=again.job_id, limit=2)]
    cursor = pages[0].next_cursor
    pages.append(checkpoints.list_checkpoints(store, job_id=again.job_id, cursor=cursor))
    assert [[one.step for one in page.items] for page in pages] == [[30, 20], [10]]
    assert pages[1].next_cursor is None


def test_imported_checkpoint_has_no_job(store: Store) -> None:
    found = checkpoints.put_checkpoint(store, policy(b"shipped"))
    assert (found.job_id, found.step) == (None, None)
    assert checkpoints.put_checkpoint(store, policy(b"shipped")) == found


@pytest.mark.parametrize("reference", ["nobody", "0" * 64])
def test_unknown_checkpoint_is_not_found(store: Store, reference: str) -> None:
    with pytest.raises(NotFound, match="no checkpoint"):
        checkpoints.get_checkpoint(store, reference)
    with pytest.raises(NotFound):
        checkpoints.read_checkpoint(store, reference)


def test_unknown_alias_names_the_known_ones(store: Store) -> None:
    new = checkpoints.put_checkpoint(store, policy(b"a"))
    checkpoints.set_alias(store, "pick", new.sha256)
    with pytest.raises(NotFound, match="no checkpoint 'pikc'; known: pick"):
        checkpoints.get_checkpoint(store, "pikc")


def test_alias_moves_to_another_checkpoint(store: Store) -> None:
    old = checkpoints.put_checkpoint(store, policy(b"old"))
    new = checkpoints.put_checkpoint(store, policy(b"new"))
    checkpoints.set_alias(store, "pick", old.sha256)
    checkpoints.set_alias(store, "pick", new.sha256)
    assert checkpoints.list_aliases(store) == {"pick": new.sha256}
    assert checkpoints.get_checkpoint(store, "pick").aliases == ("pick",)
    assert checkpoints.get_checkpoint(store, old.sha256).aliases == ()


def test_alias_of_nothing_is_refused(store: Store) -> None:
    with pytest.raises(NotFound):
        checkpoints.set_alias(store, "pick", "0" * 64)


@pytest.mark.parametrize("name", ["", "Pick", "a/b", "-a", "a" * 65, "0" * 64])
def test_bad_alias_is_refused(store: Store, name: str) -> None:
    with pytest.raises(InvalidInput, match="alias"):
        checkpoints.set_alias(store, name, "0" * 64)


def test_too_large_checkpoint_is_refused(store: Store, claim: Claim) -> None:
    new = policy(bytes(checkpoints.MAX_TENSORS + 1))
    with pytest.raises(InvalidInput, match="exceed the limit of 16777216 bytes"):
        attempts.record_checkpoint(store, claim, 1, new)


@pytest.mark.parametrize("given", ["", "xyz", "A" * 64, "0" * 63])
def test_id_that_is_no_hash_is_refused(store: Store, given: str) -> None:
    new = NewCheckpoint(sha256=given, manifest={}, tensors=b"")
    with pytest.raises(InvalidInput, match="must be 64 hexadecimal digits"):
        checkpoints.put_checkpoint(store, new)


def test_list_shows_every_checkpoint_once_newest_first(store: Store, claim: Claim) -> None:
    made = [policy(bytes([i])) for i in range(5)]
    for step, new in enumerate(made):
        attempts.record_checkpoint(store, claim, step, new)
    checkpoints.put_checkpoint(store, policy(b"imported"))
    first = checkpoints.list_checkpoints(store, limit=4)
    second = checkpoints.list_checkpoints(store, limit=4, cursor=first.next_cursor)
    seen = [item.sha256 for item in (*first.items, *second.items)]
    assert seen == [policy(b"imported").sha256, *(p.sha256 for p in reversed(made))]
    assert second.next_cursor is None


def test_list_of_a_job_shows_its_own(store: Store, claim: Claim) -> None:
    other = started(store)
    attempts.record_checkpoint(store, claim, 1, policy(b"mine"))
    attempts.record_checkpoint(store, claim, 2, policy(b"shared"))
    attempts.record_checkpoint(store, other, 3, policy(b"shared"))
    attempts.record_checkpoint(store, other, 4, policy(b"theirs"))
    mine = checkpoints.list_checkpoints(store, job_id=claim.job_id).items
    theirs = checkpoints.list_checkpoints(store, job_id=other.job_id).items
    assert [(c.step, c.job_id) for c in mine] == [(2, claim.job_id), (1, claim.job_id)]
    assert [(c.step, c.job_id) for c in theirs] == [(4, other.job_id), (3, other.job_id)]
    assert len(checkpoints.list_checkpoints(store).items) == 3


def test_dropped_checkpoint_stays_while_it_is_referenced(store: Store, claim: Claim) -> None:
    other = started(store)
    for step, content in enumerate([b"lost", b"shared", b"named", b"imported"]):
        attempts.record_checkpoint(store, claim, step, policy(content))
    attempts.record_checkpoint(
        store, other, 1, policy(b"shared"), ResumeState(step=1, manifest={}, tensors=b"")
    )
    checkpoints.set_alias(store, "kept", policy(b"named").sha256)
    checkpoints.put_checkpoint(store, policy(b"imported"))
    completion.requeue_orphans(store)
    assert attempts.claim_next(store) is not None
    left = {item.sha256 for item in checkpoints.list_checkpoints(store).items}
    assert left == {policy(c).sha256 for c in (b"shared", b"named", b"imported")}
