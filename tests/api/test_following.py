import threading
from pathlib import Path

import pytest

from app.api import following
from app.api.services import Services
from app.errors import Conflict
from app.live.commands import SetPolicy
from app.policies.checkpoints import pretrained
from app.storage_errors import StorageUnavailable
from app.store import attempts, completion, jobs
from app.store.checkpoints import drop_job_checkpoints
from app.store.engine import Store
from app.store.records import Claim, JobRecord, NewJob, ResumeState
from jobs.checkpoints import shipped
from tests.support.databases import SQLITE_ONLY, claimed
from tests.support.idle_service import add_world, idle_service, loading, own_policy
from tests.support.waiting import wait_until

pytestmark = SQLITE_ONLY


@pytest.fixture
def services(store: Store, tmp_path: Path) -> Services:
    """A service with an idle world."""
    found = idle_service(store, tmp_path)
    found.stopping.set()  # nothing but the test looks for checkpoints
    add_world(found)
    return found


@pytest.fixture
def disturbed(services: Services) -> Services:
    """The same, where a policy is chosen whenever one is loaded."""
    handle = services.worlds["main"].handle
    return loading(services, lambda: handle.submit(SetPolicy(checkpoint=None)))


@pytest.fixture
def training(store: Store) -> tuple[Claim, JobRecord]:
    """A training that runs."""
    jobs.create_job(store, NewJob(kind="train", spec={"kind": "train"}))
    return claimed(store)


def queued(services: Services) -> list[str | None]:
    """Return the checkpoints of the queued commands."""
    commands = services.worlds["main"].handle.drain()
    return [one.checkpoint for one in commands if isinstance(one, SetPolicy)]


def followed(services: Services) -> tuple[bool, int | None, str | None]:
    """Look once; return whether the world follows, and the step and checkpoint that act."""
    following.deploy_newest(services)
    now = services.follows.of("main")
    assert now is not None
    return now.active, now.step, now.checkpoint


def again(store: Store, claim: Claim) -> Claim:
    """Let the attempt of a claim crash and the job be claimed again."""
    completion.crash(store, claim, "killed", max_failures=3)
    return claimed(store)[0]


def test_world_goes_back_to_the_stored_checkpoint_of_a_resumed_training_and_takes_the_next(
    services: Services, training: tuple[Claim, JobRecord]
) -> None:
    (claim, job), kept, dropped = training, own_policy(), own_policy()
    state = ResumeState(step=5, manifest={}, tensors=b"state")
    attempts.record_checkpoint(services.store, claim, 5, kept, state)
    attempts.record_checkpoint(services.store, claim, 6, dropped)
    assert following.start("main", job, services).step == 6
    claim = again(services.store, claim)
    assert followed(services) == (True, 5, kept.sha256)
    attempts.record_checkpoint(services.store, claim, 6, dropped)
    assert followed(services) == (True, 6, dropped.sha256)
    assert queued(services) == [dropped.sha256, kept.sha256, dropped.sha256]


def test_world_takes_the_next_checkpoint_of_a_training_that_starts_at_step_0_again(
    services: Services, training: tuple[Claim, JobRecord]
) -> None:
    services.checkpoints.publish("pick", shipped("pick"))
    (claim, job), new = training, own_policy()
    attempts.record_checkpoint(services.store, claim, 5, new)  # without a state
    following.start("main", job, services)
    claim = again(services.store, claim)
    assert followed(services) == (True, None, None)
    assert followed(services) == (True, None, None)
    attempts.record_checkpoint(services.store, claim, 5, new)
    assert followed(services) == (True, 5, new.sha256)
    assert queued(services) == [new.sha256, pretrained.SHA256["pick"], new.sha256]


@pytest.mark.parametrize("reading", ["find_job", "list_checkpoints"])
def test_world_follows_on_after_a_time_without_the_database(
    services: Services,
    training: tuple[Claim, JobRecord],
    monkeypatch: pytest.MonkeyPatch,
    reading: str,
) -> None:
    (claim, job), new = training, own_policy()
    following.start("main", job, services)
    attempts.record_checkpoint(services.store, claim, 5, new)

    def unavailable(*_: object, **__: object) -> None:
        raise StorageUnavailable("sqlite:///x", "database is locked")

    with monkeypatch.context() as patch:
        patch.setattr(following, reading, unavailable)
        assert followed(services) == (True, None, None)
    assert followed(services) == (True, 5, new.sha256)


def test_follow_after_follow_leaves_one_thread(
    services: Services, training: tuple[Claim, JobRecord], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(following, "PERIOD_S", 0.05)
    (claim, job), before = training, set(threading.enumerate())
    attempts.record_checkpoint(services.store, claim, 5, own_policy())

    def n_threads() -> int:
        return sum(one.name == "following" for one in set(threading.enumerate()) - before)

    for _ in range(5):
        following.start("main", job, services)
        services.follows.thread = None  # as where another policy is chosen in between
    following.start("main", job, services)
    wait_until(lambda: n_threads() <= 1)


def test_policy_chosen_while_a_newer_checkpoint_is_loaded_is_kept(
    disturbed: Services, training: tuple[Claim, JobRecord]
) -> None:
    claim, job = training
    assert following.start("main", job, disturbed).active
    attempts.record_checkpoint(disturbed.store, claim, 5, own_policy())
    assert not following.deploy_newest(disturbed)
    found = disturbed.follows.of("main")
    assert found is not None and found.checkpoint is None
    assert (found.active, found.reason) == (False, "another policy was chosen")
    assert queued(disturbed) == [None]


def test_policy_chosen_while_the_first_checkpoint_is_loaded_is_kept(
    disturbed: Services, training: tuple[Claim, JobRecord]
) -> None:
    claim, job = training
    attempts.record_checkpoint(disturbed.store, claim, 5, own_policy())
    with pytest.raises(Conflict, match="another policy was chosen"):
        following.start("main", job, disturbed)
    assert disturbed.follows.of("main") is None
    assert queued(disturbed) == [None]


def test_policy_chosen_while_that_of_the_cell_is_loaded_is_kept(
    services: Services, disturbed: Services, training: tuple[Claim, JobRecord]
) -> None:
    services.checkpoints.publish("pick", shipped("pick"))
    (claim, job), new = training, own_policy()
    attempts.record_checkpoint(services.store, claim, 5, new)
    following.start("main", job, services)
    with services.store.writing() as connection:
        drop_job_checkpoints(connection, job.id, beyond=-1)
    assert not following.deploy_newest(disturbed)
    found = services.follows.of("main")
    assert found is not None and found.reason == "another policy was chosen"
    assert queued(services) == [new.sha256, None]
