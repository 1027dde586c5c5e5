import os
import signal
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from threading import Thread

import pytest

from app.api.registry import CheckpointNames
from app.errors import Conflict
from app.storage_errors import StorageUnavailable
from app.store import attempts, checkpoints, events, job_actions, jobs, metrics
from app.store.database.lease import Lease
from app.store.database.lock import ServerLock
from app.store.engine import Store
from jobs.executor import LocalExecutor
from jobs.retention import Retention
from jobs.supervisor import Supervisor
from tests.jobs.machinery import (
    PATIENCE,
    assert_counted_once,
    is_running,
    queue,
    supervised,
    supervisor_process,
    wait_for,
    wait_until,
    wait_until_final,
    worker_pids,
)
from tests.jobs.supervisor_process import COUNTING
from tests.store.test_attempts import policy
from tests.support.databases import POSTGRESQL_ONLY, SQLITE_ONLY, wait_until_lease_expires
from tests.support.postgresql_server import PostgresqlServer


def test_job_runs_to_its_end(store: Store, supervisor: Supervisor) -> None:
    job_id = queue(store, seed=3, steps=40)
    supervisor.wake()
    job = wait_until_final(store, job_id)
    assert (job.state, job.attempt, job.failures) == ("succeeded", 1, 0)
    assert_counted_once(store, job_id, steps=40, seed=3)


@pytest.mark.usefixtures("supervisor")
@SQLITE_ONLY
def test_no_more_jobs_run_at_once_than_allowed(store: Store) -> None:
    first = queue(store, steps=100, hold_at=[22])
    second = queue(store, steps=20)
    wait_for(store, first, lambda job: job.step == 20)
    assert jobs.get_job(store, second).state == "queued"
    jobs.request_cancel(store, first)
    assert wait_until_final(store, second).state == "succeeded"


@pytest.mark.usefixtures("supervisor")
def test_killed_worker_goes_on_from_its_checkpoint(store: Store) -> None:
    job_id = queue(store, seed=5, steps=100, hold_at=[67])
    wait_for(store, job_id, lambda job: job.step == 65)
    (pid,) = worker_pids(os.getpid())
    os.kill(pid, signal.SIGKILL)
    job = wait_until_final(store, job_id)
    assert (job.state, job.attempt, job.failures, job.error) == ("succeeded", 2, 1, None)
    assert_counted_once(store, job_id, steps=100, seed=5)


def test_worker_that_a_service_manager_terminates_is_no_crash(
    store: Store, tmp_path: Path, executor: LocalExecutor
) -> None:
    timeouts = replace(PATIENCE, retry_s=0.1)
    with supervised(store, tmp_path, executor=executor, timeouts=timeouts):
        job_id = queue(store, steps=100, hold_at=[27, 67, 87], at_once=True)
        for goal in (25, 65, 85):
            wait_for(store, job_id, lambda job, goal=goal: job.step == goal)
            (pid,) = worker_pids(os.getpid())
            os.kill(pid, signal.SIGTERM)
        job = wait_until_final(store, job_id)
    assert (job.state, job.attempt, job.failures) == ("succeeded", 4, 0)


@pytest.mark.usefixtures("supervisor")
def test_job_that_always_crashes_fails_with_its_last_words(store: Store) -> None:
    job_id = queue(store, steps=40, raise_at=25)
    job = wait_until_final(store, job_id)
    assert (job.state, job.attempt) == ("failed", 3)
    assert job.error is not None and "Failed after 3 attempts" in job.error
    assert "RuntimeError: deliberate crash at step 25" in job.error
    assert [c.step for c in checkpoints.list_checkpoints(store).items] == [20]


@pytest.mark.usefixtures("supervisor")
@SQLITE_ONLY
def test_bad_input_found_by_the_worker_fails_at_once(store: Store) -> None:
    job = wait_until_final(store, queue(store, steps=40, refuse_at=7))
    assert (job.state, job.attempt) == ("failed", 1)
    assert job.error == "refuse_at = 7 must not be reached"


@pytest.mark.usefixtures("supervisor")
@SQLITE_ONLY
def test_unknown_kind_fails_and_names_the_known(store: Store) -> None:
    job = wait_until_final(store, queue(store, kind="dream"))
    assert job.state == "failed"
    assert job.error == "kind = 'dream' must be a kind of job; choices: count"


@pytest.mark.usefixtures("supervisor")
def test_cancelled_job_leaves_a_last_checkpoint_and_resumes_from_it(
    store: Store, supervisor: Supervisor
) -> None:
    job_id = queue(store, steps=100, hold_at=[27])
    wait_for(store, job_id, lambda job: job.step == 25)
    jobs.request_cancel(store, job_id)
    job = wait_until_final(store, job_id)
    newest = checkpoints.list_checkpoints(store, job_id=job_id).items[0]
    assert (job.state, job.attempt, job.error) == ("cancelled", 1, None)
    assert newest.step == 27
    job_actions.resume_job(store, job_id)
    supervisor.wake()
    job = wait_until_final(store, job_id)
    assert (job.state, job.attempt, job.failures) == ("succeeded", 2, 0)
    steps = [row.step for row in metrics.list_metrics(store, job_id)]
    assert steps == list(range(5, 101, 5))


@pytest.mark.usefixtures("supervisor")
def test_job_cancelled_while_its_worker_starts_has_not_crashed(store: Store) -> None:
    job_id = queue(store, steps=100)
    wait_for(store, job_id, lambda job: job.state == "running")
    jobs.request_cancel(store, job_id)
    job = wait_until_final(store, job_id)
    assert (job.state, job.failures, job.error) == ("cancelled", 0, None)


@pytest.mark.usefixtures("supervisor")
@SQLITE_ONLY
def test_deaf_worker_is_killed_after_the_grace_time(store: Store) -> None:
    job_id = queue(store, steps=100, hold_at=[7], deaf=True)
    wait_for(store, job_id, lambda job: job.step >= 5)
    jobs.request_cancel(store, job_id)
    job = wait_until_final(store, job_id)
    assert (job.state, job.failures) == ("cancelled", 0)


@pytest.mark.slow
def test_worker_without_a_sign_of_life_is_killed_and_the_job_goes_on(
    store: Store, tmp_path: Path, executor: LocalExecutor
) -> None:
    timeouts = replace(PATIENCE, silence_s=20.0)
    with supervised(store, tmp_path, executor=executor, timeouts=timeouts):
        job_id = queue(store, steps=100, hold_at=[27])
        wait_for(store, job_id, lambda job: job.step == 25)
        (pid,) = worker_pids(os.getpid())
        os.kill(pid, signal.SIGSTOP)
        job = wait_until_final(store, job_id)
    assert (job.state, job.attempt, job.failures) == ("succeeded", 2, 1)


def test_stopped_server_queues_its_job_again_and_the_next_one_finishes_it(
    store: Store, tmp_path: Path, executor: LocalExecutor
) -> None:
    job_id = queue(store, steps=100, hold_at=[27])
    with supervised(store, tmp_path, executor=executor):
        wait_for(store, job_id, lambda job: job.step == 25)
    job = jobs.get_job(store, job_id)
    resume = attempts.load_resume(store, job_id)
    assert (job.state, job.failures) == ("queued", 0)
    assert resume is not None and resume.step == 27
    with supervised(store, tmp_path, executor=executor):
        assert wait_until_final(store, job_id).failures == 0
    assert [row.step for row in metrics.list_metrics(store, job_id)] == list(range(5, 101, 5))


def test_killed_server_takes_its_worker_along_and_the_next_one_finishes_the_job(
    store: Store, tmp_path: Path
) -> None:
    job_id = queue(store, seed=9, steps=100, hold_at=[27, 90])
    pids = []
    for goal in (25, 90):
        with supervisor_process(store, tmp_path) as server:
            wait_for(store, job_id, lambda job, goal=goal: job.step == goal)
            pids += worker_pids(server.pid)
            server.kill()
    with supervisor_process(store, tmp_path):
        job = wait_until_final(store, job_id)
    assert (job.state, job.attempt, job.failures) == ("succeeded", 3, 0)
    assert_counted_once(store, job_id, steps=100, seed=9)
    assert len(pids) == 2 and not any(map(is_running, pids))


@POSTGRESQL_ONLY
def test_second_server_from_another_folder_is_refused(store: Store, tmp_path: Path) -> None:
    with supervisor_process(store, tmp_path / "a") as server:
        rule = rf"process {server.pid} on .* holds the lease of postgresql.* until"
        with pytest.raises(Conflict, match=rule):
            Supervisor(store, tmp_path / "b").start()
        assert wait_until_final(store, queue(store, steps=40)).attempt == 1


def start_patiently(supervisor: Supervisor) -> None:
    """Start once PostgreSQL has ended the transaction in which the other server was paused."""
    while not supervisor.is_alive:
        with suppress(StorageUnavailable):
            supervisor.start()


def test_alias_is_set_although_another_server_has_changed_it(store: Store) -> None:
    first, second = policy(b"1"), policy(b"2")
    for one in (first, second):
        checkpoints.put_checkpoint(store, one)
    here, there = CheckpointNames(store), CheckpointNames(store)
    here.point("line-2", first.sha256)
    there.point("line-2", second.sha256)
    here.point("line-2", first.sha256)
    assert checkpoints.list_aliases(store) == here.aliases == {"line-2": first.sha256}


def test_jobs_that_end_without_a_worker_are_removed_beyond_those_to_keep(
    store: Store, tmp_path: Path, executor: LocalExecutor
) -> None:
    keep = Retention(
        store=store, logs=tmp_path / "logs", keep_jobs=2, keep_states=1, acting=dict
    )
    for _ in range(5):
        jobs.request_cancel(store, queue(store))
    times = replace(PATIENCE, retain_s=0.1)
    with supervised(store, tmp_path, timeouts=times, executor=executor, retention=keep):
        wait_until(lambda: jobs.count_jobs(store)["cancelled"] == 2)
        jobs.request_cancel(store, queue(store))
        wait_until(lambda: [one.number for one in jobs.list_jobs(store).items] == [6, 5])


@SQLITE_ONLY
def test_server_that_takes_its_lease_again_knows_the_aliases_of_the_other(
    store: Store, tmp_path: Path, executor: LocalExecutor
) -> None:
    first, second = policy(b"1"), policy(b"2")
    for one in (first, second):
        checkpoints.put_checkpoint(store, one)
    checkpoints.set_alias(store, "line-2", first.sha256)
    names = CheckpointNames(store)
    supervisor = Supervisor(store, tmp_path, executor=executor, timeouts=PATIENCE)
    supervisor.on_lease = names.refresh
    supervisor.start()
    with store.writing() as connection:
        Lease(store, ServerLock(store, tmp_path / "other")).take(connection)
    checkpoints.set_alias(store, "line-2", second.sha256)
    wait_until_final(store, queue(store, steps=20))
    supervisor.stop()
    assert names.aliases["line-2"] == second.sha256


@POSTGRESQL_ONLY
def test_server_paused_beyond_its_lease_stops_its_worker_and_waits(
    store: Store, tmp_path: Path
) -> None:
    job_id = queue(store, seed=4, steps=100, hold_at=[27, 67], deaf=True)
    with supervisor_process(store, tmp_path / "a", lease_s=1.0) as paused:
        wait_for(store, job_id, lambda job: job.step == 25)
        (pid,) = worker_pids(paused.pid)
        paused.send_signal(signal.SIGSTOP)
        wait_until_lease_expires(store)
        executor = LocalExecutor(store.url, tmp_path / "b", COUNTING)
        timeouts = replace(PATIENCE, lease_s=1000.0, shutdown_s=0.0)
        second = Supervisor(store, tmp_path / "b", executor=executor, timeouts=timeouts)
        start_patiently(second)
        wait_for(store, job_id, lambda job: job.step == 65)
        paused.send_signal(signal.SIGCONT)
        wait_until(lambda: not is_running(pid))
        job = jobs.get_job(store, job_id)
        assert (job.state, job.attempt, job.failures) == ("running", 2, 0)
        second.stop()
        job = wait_until_final(store, job_id)  # the first server takes the lease again
    assert (job.state, job.attempt, job.failures) == ("succeeded", 3, 0)
    assert_counted_once(store, job_id, steps=100, seed=4)


@POSTGRESQL_ONLY
def test_stopping_server_keeps_its_lease_until_its_workers_have_ended(
    store: Store, tmp_path: Path, executor: LocalExecutor
) -> None:
    timeouts = replace(PATIENCE, lease_s=1.0, shutdown_s=4.0)
    job_id = queue(store, steps=100, hold_at=[7], deaf=True)
    lock = ServerLock(store, tmp_path / "b")
    lock.acquire()
    with supervised(store, tmp_path / "a", executor=executor, timeouts=timeouts) as first:
        wait_for(store, job_id, lambda job: job.step == 5)
        stop = Thread(target=first.stop)
        stop.start()
        time.sleep(2.5)
        with pytest.raises(Conflict, match="holds the lease"):
            Lease(store, lock).check()
        stop.join()
        Lease(store, lock).check()
    lock.release()
    assert jobs.get_job(store, job_id).state == "queued"


@POSTGRESQL_ONLY
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGQUIT], ids=["shutdown", "crash"])
def test_job_ends_once_although_the_database_restarts(
    store: Store, tmp_path: Path, postgresql: PostgresqlServer, how: signal.Signals
) -> None:
    job_id = queue(store, seed=8, steps=1000)
    with supervisor_process(store, tmp_path / "a", lease_s=1000.0) as server:
        for goal in (100, 300):
            wait_for(store, job_id, lambda job, goal=goal: job.step >= goal)
            postgresql.stop(how)
            postgresql.start()
            with pytest.raises(Conflict, match=f"process {server.pid} on"):
                Supervisor(store, tmp_path / "b").start()
        assert wait_until_final(store, job_id).state == "succeeded"
    states = [event.data.get("state") for event in events.list_events(store, job_id)]
    assert states.count("succeeded") == 1
    assert_counted_once(store, job_id, steps=1000, seed=8)


def test_second_server_on_one_folder_is_refused(store: Store, tmp_path: Path) -> None:
    with supervisor_process(store, tmp_path) as server:
        job_id = queue(store, steps=40)
        with pytest.raises(Conflict, match=rf"process {server.pid}\) already uses"):
            Supervisor(store, tmp_path).start()
        assert wait_until_final(store, job_id).attempt == 1


@pytest.mark.usefixtures("supervisor")
def test_row_left_running_without_a_worker_is_started_again(store: Store) -> None:
    job_id = queue(store, steps=20)
    attempts.claim_next(store)
    assert wait_until_final(store, job_id).state == "succeeded"


@SQLITE_ONLY
def test_worker_that_cannot_be_started_fails_the_job(
    store: Store, tmp_path: Path, executor: LocalExecutor
) -> None:
    (tmp_path / "logs").write_text("no folder")
    with supervised(store, tmp_path, executor=executor):
        job = wait_until_final(store, queue(store, steps=20))
    assert job.error is not None and "could not be started" in job.error


@pytest.mark.usefixtures("supervisor")
@SQLITE_ONLY
def test_log_of_a_job_carries_its_id_in_each_line(store: Store, tmp_path: Path) -> None:
    job_id = queue(store, steps=20)
    wait_until_final(store, job_id)
    log = tmp_path / "logs" / f"{job_id}.log"
    lines = wait_until(log.read_text, lambda text: "succeeded" in text).splitlines()
    assert lines and all(f"job_id={job_id} attempt=1" in line for line in lines)
