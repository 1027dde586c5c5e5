from pathlib import Path

import pytest

from app.api import following
from app.api.services import Services
from app.errors import Conflict
from app.live.commands import SetPolicy
from app.store import attempts, jobs
from app.store.checkpoints import drop_job_checkpoints
from app.store.engine import Store
from app.store.records import Claim, JobRecord, NewJob
from jobs.checkpoints import shipped
from tests.support.databases import SQLITE_ONLY, claimed
from tests.support.idle_service import add_world, idle_service, loading, own_policy

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
