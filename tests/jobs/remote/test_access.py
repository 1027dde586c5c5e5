"""A worker on another machine reads and writes what the database would give and take."""

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from hashlib import sha256
from http.client import HTTPConnection
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save

from app.errors import InvalidInput, ServiceError
from app.storage_errors import ServerUnreachable, StaleAttempt
from app.store import attempts, checkpoints, completion, events, jobs, metrics
from app.store.database.tables import jobs as jobs_table
from app.store.engine import Store
from app.store.records import Claim, NewCheckpoint, ResumeState
from jobs.access import EndOfAttempt
from jobs.checkpoints import to_store
from jobs.inputs import StoreInputs
from jobs.recording_catalog import RecordingCatalog
from jobs.remote.access import ServiceAccess
from jobs.remote.connection import ServiceConnection
from jobs.remote.inputs import ServiceFiles, ServiceInputs
from jobs.remote.uploads import MAX_MEMORY_FILE, pack_upload
from jobs.spec import parse_spec
from jobs.worker import JobWorker
from tests.jobs.machinery import wait_until
from tests.jobs.remote.serving import TOKEN
from tests.policies.evaluation.sorting_players import untrained
from tests.sim.recorded_person import csv_text, working
from tests.support.databases import SQLITE_ONLY, claimed
from tests.support.failing_proxy import FailingProxy, failing_proxy

pytestmark = SQLITE_ONLY
SPEC = {"kind": "train", "preset": "sorting-e0-dqn", "seed": 1}
POLICY = untrained()
NEW = to_store(POLICY)
ROWS = save({"rewards": np.arange(3.0)})
ROWS_SHA256 = sha256(ROWS).hexdigest()


@pytest.fixture
def claim(store: Store) -> Claim:
    jobs.create_job(store, parse_spec(SPEC).new_job())
    return claimed(store)[0]


@pytest.fixture
def service(address: str, claim: Claim) -> Iterator[ServiceConnection]:
    with closing(ServiceConnection(address, TOKEN, claim)) as one:
        yield one


@pytest.fixture
def access(service: ServiceConnection) -> ServiceAccess:
    return ServiceAccess(service)


def state(step: int, *files: str) -> ResumeState:
    memory = [{"first": 0, "last": 3, "sha256": name} for name in files]
    tensors = save({"step": np.array([step])})
    values = {"increment": 2**127 + 1, "rate": 0.1}
    return ResumeState(
        step=step, manifest={"memory": memory, "values": values}, tensors=tensors
    )


def test_job_is_that_of_the_database(store: Store, access: ServiceAccess, claim: Claim) -> None:
    stored = jobs.get_job(store, claim.job_id)
    found = access.job()
    assert {
        name: getattr(found, name) for name in stored.__slots__ if name != "heartbeat_at"
    } == {name: getattr(stored, name) for name in stored.__slots__ if name != "heartbeat_at"}
    jobs.request_cancel(store, claim.job_id)
    assert access.heartbeat("disk full", 2.5).cancel_requested
    assert jobs.get_job(store, claim.job_id).waiting == "disk full"


def test_numbers_of_the_curve_keep_their_bits_and_kinds(
    store: Store, access: ServiceAccess, claim: Claim
) -> None:
    values = {"rate": 0.1 + 0.2, "small": 5e-324, "count": 3, "undefined": None}
    access.record_progress(128, values, total_steps=256)
    (row,) = metrics.list_metrics(store, claim.job_id)
    assert row.values == values and type(row.values["count"]) is int
    access.record_progress(128, values, total_steps=256)  # as after an answer that was lost
    with pytest.raises(ServiceError, match="step = 128 must lie above the last recorded"):
        access.record_progress(128, {**values, "count": 4}, None)


def test_reason_that_the_column_cannot_hold_is_refused(access: ServiceAccess) -> None:
    longest = jobs_table.c.waiting.type.length
    assert access.heartbeat("w" * longest, 0.0).waiting == "w" * longest
    with pytest.raises(ServiceError, match=f"waiting = .* at most {longest} characters"):
        access.heartbeat("w" * (longest + 1), 0.0)


@pytest.mark.parametrize("step", [10, None])
def test_states_return_as_they_were_sent_and_the_one_before_an_unusable_one(
    store: Store, address: str, access: ServiceAccess, claim: Claim, step: int | None
) -> None:
    assert access.load_resume(lambda _: True) is None
    for step in (10, 20):
        access.record_checkpoint(step, NEW, state(step))
    assert access.load_resume(lambda _: True) == state(20)
    assert access.load_resume(lambda one: one.step < 20) == state(10)
    assert access.load_resume(lambda _: False) is None
    completion.give_back(store, claim)
    with closing(ServiceConnection(address, TOKEN, claimed(store)[0])) as service:
        second = ServiceAccess(service)
        for _ in range(2):  # the first answer may be lost
            second.resume_earlier(step)
        expected = None if step is None else state(step)
        assert (second.load_resume(lambda _: True), second.job().step) == (expected, step or 0)
        second.record_progress(15, {}, None)
        second.resume_earlier(step)
        assert second.job().step == 15


def test_files_that_no_state_lists_are_deleted_with_the_next_checkpoint(
    tmp_path: Path, access: ServiceAccess, service: ServiceConnection, claim: Claim
) -> None:
    files = ServiceFiles(service)
    other = save({"rewards": np.arange(5.0)})
    for content in (ROWS, other):
        files.write(sha256(content).hexdigest(), content)
    assert files.read(ROWS_SHA256) == ROWS
    access.record_checkpoint(10, NEW, state(10, ROWS_SHA256))
    folder = tmp_path / "resume" / claim.job_id
    assert [one.name for one in folder.iterdir()] == [f"{ROWS_SHA256}.safetensors"]
    with pytest.raises(FileNotFoundError):
        files.read(sha256(other).hexdigest())
    access.end(EndOfAttempt("succeeded", {"step": 10}))
    assert not folder.exists()


def test_upload_that_arrives_again_deletes_no_later_file(
    store: Store, access: ServiceAccess, service: ServiceConnection, claim: Claim
) -> None:
    files, other = ServiceFiles(service), save({"rewards": np.arange(5.0)})
    files.write(ROWS_SHA256, ROWS)
    access.record_checkpoint(10, NEW, state(10, ROWS_SHA256))
    before = events.list_events(store, claim.job_id)
    files.write(sha256(other).hexdigest(), other)
    access.record_checkpoint(10, NEW, state(10, ROWS_SHA256))
    assert events.list_events(store, claim.job_id) == before
    later = state(20, ROWS_SHA256, sha256(other).hexdigest())
    access.record_checkpoint(20, NEW, later)
    assert access.load_resume(lambda _: True) == later


def test_upload_that_arrives_after_a_later_one_is_refused(access: ServiceAccess) -> None:
    for step in (10, 20):
        access.record_checkpoint(step, NEW, state(step))
    with pytest.raises(ServiceError, match="step = 10 must not lie below 20, the last"):
        access.record_checkpoint(10, NEW, state(10))
    assert access.load_resume(lambda _: True) == state(20)


@pytest.mark.parametrize(
    ("content", "name", "fault"),
    [
        (ROWS, "0" * 64, "is not that of the body"),
        (b"\x80\x04.", sha256(b"\x80\x04.").hexdigest(), "must be a safetensors file"),
        (ROWS, "..passwd", "sha256 = '..passwd' is not that of the body"),
    ],
    ids=["hash", "pickle", "path"],
)
def test_file_that_is_not_what_it_must_be_is_refused(
    tmp_path: Path, service: ServiceConnection, content: bytes, name: str, fault: str
) -> None:
    with pytest.raises(ServiceError, match=fault):
        ServiceFiles(service).write(name, content)
    assert not (tmp_path / "resume").exists()


@pytest.mark.parametrize(
    ("resume", "changes", "fault"),
    [
        (state(10, "0" * 64), {}, r"state.manifest.memory\[0\] = .* send it first"),
        (state(10, "../secret"), {}, "must be 64 hexadecimal digits"),
        (state(20), {}, "resume.step = 20 must equal the checkpoint's 10"),
        (ResumeState(step=10, manifest={}, tensors=b"\x80\x04."), {}, "a safetensors file"),
        (replace(state(10), manifest={"memory": 5}), {}, "manifest.memory = 'int' must be a"),
        (replace(state(10), manifest={"a": "\ud800"}), {}, "must be JSON in UTF-8"),
        (state(10), {"seed": 2}, "manifest.seed = 2 must be the job's, 1"),
        (state(10), {"width": "16"}, "manifest.width = '16' must be int"),
    ],
    ids=["missing", "path", "step", "pickle", "list", "text", "origin", "type"],
)
def test_checkpoint_that_breaks_a_rule_stores_nothing(
    store: Store,
    access: ServiceAccess,
    claim: Claim,
    resume: ResumeState,
    changes: dict[str, object],
    fault: str,
) -> None:
    policy = NewCheckpoint(sha256="", manifest={**NEW.manifest, **changes}, tensors=NEW.tensors)
    with pytest.raises(ServiceError, match=fault):
        access.record_checkpoint(10, policy, resume)
    assert checkpoints.list_checkpoints(store).items == ()
    assert attempts.load_resume(store, claim.job_id) is None


def test_torn_upload_stores_nothing(
    store: Store, service: ServiceConnection, claim: Claim
) -> None:
    content, policy_bytes = pack_upload(NEW, state(10))
    query = {"step": 10, "policy_bytes": policy_bytes, "sha256": sha256(content).hexdigest()}
    with pytest.raises(ServiceError, match="is not that of the body"):
        path = f"{service.attempt}/checkpoints"
        service.send("POST", path, query=query, content=content[:-1])
    assert checkpoints.list_checkpoints(store, job_id=claim.job_id).items == ()


WRITES: dict[str, Callable[[ServiceConnection], object]] = {
    "job": lambda service: ServiceAccess(service).job(),
    "heartbeat": lambda service: ServiceAccess(service).heartbeat(None, 0.0),
    "progress": lambda service: ServiceAccess(service).record_progress(9, {}, None),
    "checkpoint": lambda service: ServiceAccess(service).record_checkpoint(9, NEW, state(9)),
    "state": lambda service: ServiceAccess(service).load_resume(lambda _: True),
    "start": lambda service: ServiceAccess(service).resume_earlier(None),
    "end": lambda service: ServiceAccess(service).end(EndOfAttempt("succeeded")),
    "write file": lambda service: ServiceFiles(service).write(ROWS_SHA256, ROWS),
    "read file": lambda service: ServiceFiles(service).read(ROWS_SHA256),
}


@pytest.mark.parametrize("act", WRITES.values(), ids=WRITES)
def test_earlier_attempt_is_refused_and_changes_nothing(
    store: Store,
    tmp_path: Path,
    service: ServiceConnection,
    claim: Claim,
    act: Callable[[ServiceConnection], object],
) -> None:
    completion.give_back(store, claim)
    second = claimed(store)[0]
    before = jobs.get_job(store, claim.job_id)
    with pytest.raises(StaleAttempt, match="attempt 1 no longer holds job"):
        act(service)
    assert jobs.get_job(store, claim.job_id) == before
    assert before.attempt == second.attempt == 2
    assert metrics.list_metrics(store, claim.job_id) == ()
    assert checkpoints.list_checkpoints(store).items == ()
    assert not (tmp_path / "resume").exists()


@pytest.mark.parametrize(
    ("state_of_end", "expected"),
    [
        ("succeeded", "succeeded"),
        ("cancelled", "cancelled"),
        ("failed", "failed"),
        ("interrupted", "queued"),
    ],
)
def test_end_of_an_attempt_is_recorded(
    store: Store, access: ServiceAccess, claim: Claim, state_of_end: str, expected: str
) -> None:
    error = "rewards were not finite" if state_of_end == "failed" else None
    access.end(EndOfAttempt(state_of_end, error=error))  # type: ignore[arg-type]
    job = jobs.get_job(store, claim.job_id)
    assert (job.state, job.error) == (expected, error)


def test_inputs_are_those_of_the_database(
    store: Store, tmp_path: Path, service: ServiceConnection, claim: Claim
) -> None:
    checkpoints.put_checkpoint(store, NEW)
    RecordingCatalog(store).add(csv_text(working(100, seed=1)).encode(), "waves.csv", "waves")
    remote, local = ServiceInputs(service), StoreInputs(store, tmp_path, claim.job_id)
    found, stored = remote.checkpoint(NEW.sha256), local.checkpoint(NEW.sha256)
    assert (found.sha256, found.manifest, found.tensors) == (
        stored.sha256,
        stored.manifest,
        stored.tensors,
    )
    for one, two in zip(remote.motions(["waves"]), local.motions(["waves"]), strict=True):
        assert (one.name, one.source, one.size) == (two.name, two.source, two.size)
        assert np.array_equal(one.q, two.q) and np.array_equal(one.times, two.times)
    with pytest.raises(InvalidInput, match=r"recordings\[0\] = 'nods' is not a stored"):
        remote.motions(["nods"])
    with pytest.raises(ServiceError, match="no checkpoint 'nobody'"):
        remote.checkpoint("nobody")


def test_worker_without_the_token_is_refused(address: str, claim: Claim) -> None:
    with closing(ServiceConnection(address, None, claim)) as stranger:
        with pytest.raises(ServiceError, match="needs its token"):
            ServiceAccess(stranger).job()


def test_server_that_does_not_answer_may_answer_later(claim: Claim) -> None:
    with closing(ServiceConnection("http://127.0.0.1:1", TOKEN, claim)) as service:
        with pytest.raises(ServerUnreachable) as found:
            ServiceAccess(service).job()
    assert found.value.short == "server unreachable"


@contextmanager
def through_proxy(address: str, claim: Claim) -> Iterator[tuple[FailingProxy, ServiceAccess]]:
    """Yield a proxy before the server, and a worker's access to its job through it."""
    with (
        failing_proxy(address) as proxy,
        closing(ServiceConnection(proxy.address, TOKEN, claim)) as service,
    ):
        yield proxy, ServiceAccess(service)


@pytest.mark.parametrize("status", [302, 307, 404, 408, 429, 502])
def test_request_that_a_proxy_refused_for_now_is_repeated(
    address: str, claim: Claim, status: int
) -> None:
    with through_proxy(address, claim) as (proxy, access):
        proxy.failures = [status]
        with pytest.raises(ServerUnreachable, match=str(status)):
            access.record_progress(64, {"reward": 1.0}, None)
        access.record_progress(64, {"reward": 1.0}, None)


def test_worker_sees_a_cancel_after_a_heartbeat_that_failed(
    store: Store, address: str, claim: Claim
) -> None:
    with through_proxy(address, claim) as (proxy, access):

        def run(worker: JobWorker) -> None:
            proxy.failures = [500, 500]
            wait_until(lambda: not proxy.failures)
            jobs.request_cancel(store, claim.job_id)
            wait_until(worker.should_stop)

        assert JobWorker(access).execute(run) == 0
    assert jobs.get_job(store, claim.job_id).state == "cancelled"


def test_file_beyond_the_limit_is_refused_unread(address: str, claim: Claim) -> None:
    path = f"/v1/jobs/{claim.job_id}/attempts/{claim.attempt}/files/{ROWS_SHA256}"
    with closing(HTTPConnection(address.removeprefix("http://"))) as connection:
        connection.putrequest("PUT", path)
        connection.putheader("Authorization", f"Bearer {TOKEN}")
        connection.putheader("Content-Length", str(MAX_MEMORY_FILE + 1))
        connection.endheaders()
        assert connection.getresponse().status == 413
