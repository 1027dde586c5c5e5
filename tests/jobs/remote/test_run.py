"""A worker that has neither the database nor the data folder."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from app.store import attempts, jobs, metrics
from app.store.engine import Store
from jobs.executor import LocalExecutor
from jobs.remote.access import ServiceAccess
from jobs.remote.connection import ServiceConnection
from jobs.remote.inputs import ServiceInputs
from jobs.run import runners
from jobs.spec import parse_spec
from jobs.supervisor import Supervisor
from jobs.worker import JobWorker
from tests.jobs.machinery import PATIENCE, supervised, wait_for
from tests.jobs.remote.serving import TOKEN, serving
from tests.support.databases import SQLITE_ONLY, claimed
from tests.support.trainings import Made, killed_midway, made_by, train

pytestmark = SQLITE_ONLY


def elsewhere(folder: Path, address: str) -> LocalExecutor:
    """Workers as on another machine: a folder of their own, the address and the token."""
    settings = {"TANDEM_WORKER_URL": address, "TANDEM_TOKEN": TOKEN}
    return LocalExecutor(None, folder / "elsewhere", "jobs.remote.run", settings)


def test_training_over_http_killed_once_ends_with_the_checkpoints_of_a_local_one(
    store: Store, tmp_path: Path, address: str, undisturbed: Made
) -> None:
    with supervised(store, tmp_path, executor=elsewhere(tmp_path, address)):
        killed = killed_midway(store, tmp_path)
    assert (killed.state, killed.error, killed.attempt) == ("succeeded", None, 2)
    assert made_by(store, killed.id) == undisturbed
    steps = [point.step for point in metrics.list_metrics(store, killed.id)]
    assert steps == list(range(128, 2049, 128))
    assert not (tmp_path / "elsewhere" / "resume").exists()


def test_stopping_server_takes_the_last_state_over_http(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TANDEM_TOKEN_FILE", "/run/secrets/token")  # the server's; not read
    timeouts = replace(PATIENCE, shutdown_s=120.0)
    with serving(store, tmp_path) as (address, parts):
        executor = elsewhere(tmp_path, address)
        parts.supervisor = Supervisor(store, tmp_path, executor=executor, timeouts=timeouts)
        parts.supervisor.start()
        job_id = train(store, **{"learning.total_steps": 200_000})
        wait_for(store, job_id, lambda job: job.step >= 128)
    job, state = jobs.get_job(store, job_id), attempts.load_resume(store, job_id)
    assert (job.state, job.failures) == ("queued", 0)
    assert state is not None and state.step >= job.step


def test_evaluation_of_an_unknown_checkpoint_fails_over_http_as_locally(
    store: Store, address: str
) -> None:
    body = {"kind": "evaluate", "protocol": "pick-single", "checkpoint": "nobody"}
    jobs.create_job(store, parse_spec(body).new_job())
    claim, _ = claimed(store)
    with closing(ServiceConnection(address, TOKEN, claim)) as service:
        run = runners(ServiceInputs(service))["evaluate"]
        assert JobWorker(ServiceAccess(service)).execute(run) == 0
    job = jobs.get_job(store, claim.job_id)
    assert (job.state, job.error) == ("failed", "no checkpoint 'nobody'")
