"""The real runners: trainings and an evaluation in real processes, others in this one."""

import os
import signal
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from app.main import executor_of
from app.policies.checkpoints import pretrained
from app.policies.checkpoints.trained_cell import is_for
from app.settings import Settings
from app.store import attempts, checkpoints, events, job_actions, jobs, metrics
from app.store.engine import Store
from app.store.records import Claim
from jobs.cell_catalog import CellCatalog
from jobs.checkpoints import shipped, to_store
from jobs.recording_catalog import RecordingCatalog
from jobs.spec import parse_spec
from jobs.supervisor import Supervisor
from tests.jobs.machinery import (
    supervised,
    wait_for,
    wait_until,
    wait_until_final,
    worker_pids,
)
from tests.policies.evaluation.sorting_players import untrained
from tests.sim.recorded_person import csv_text, working
from tests.support import workshop
from tests.support.databases import SQLITE_ONLY
from tests.support.trainings import Made, killed_midway, made_by, run_here, train


@pytest.fixture
def supervisor(store: Store, tmp_path: Path) -> Iterator[Supervisor]:
    """A supervisor that runs real jobs."""
    with supervised(store, tmp_path) as started:
        yield started


@SQLITE_ONLY
def test_worker_finds_a_database_whose_path_is_relative_to_the_server(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert store.sqlite_path is not None
    monkeypatch.chdir(store.sqlite_path.parent)
    settings = Settings(data=tmp_path, database_url=f"sqlite:///{store.sqlite_path.name}")
    executor = executor_of(settings, Store(settings.database).url)
    started = executor.start(Claim(job_id="unknown", attempt=1))
    wait_until(lambda: executor.poll(started) is not None)
    ended = executor.poll(started)
    assert ended is not None and "attempt 1 no longer holds job unknown" in ended.tail


@pytest.mark.usefixtures("supervisor")
def test_training_stores_its_curve_and_policies(store: Store, undisturbed: Made) -> None:
    job_id = train(store)
    job = wait_until_final(store, job_id)
    assert (job.state, job.error, job.attempt) == ("succeeded", None, 1)
    assert [m.step for m in metrics.list_metrics(store, job_id)] == list(range(128, 2049, 128))
    made = checkpoints.list_checkpoints(store, job_id=job_id).items
    assert [c.step for c in made] == [2048, 1536, 1024, 512]
    assert job.result == {"checkpoint": made[0].sha256, "step": 2048}
    assert made_by(store, job_id) == undisturbed
    assert attempts.load_resume(store, job_id) is None


@pytest.mark.usefixtures("supervisor")
@SQLITE_ONLY
def test_killed_training_ends_with_the_checkpoints_of_one_that_was_not(
    store: Store, tmp_path: Path, undisturbed: Made
) -> None:
    killed = killed_midway(store, tmp_path)
    assert (killed.state, killed.attempt) == ("succeeded", 2)
    assert made_by(store, killed.id) == undisturbed
    folder = tmp_path / "resume" / killed.id  # removed after the end is recorded
    wait_until(lambda: not folder.exists())


@pytest.mark.usefixtures("supervisor")
@SQLITE_ONLY
def test_training_that_a_budget_ended_goes_on_to_the_same_bits(
    store: Store, undisturbed: Made
) -> None:
    job = wait_until_final(store, train(store, step_budget=700))
    assert (job.state, job.ended_by, job.step) == ("succeeded", "step budget", 768)
    assert job.result is not None and job.result["step"] == 768
    job_actions.resume_job(store, job.id, {"step_budget": None})
    job = wait_until_final(store, job.id)
    assert (job.ended_by, job.result) == (None, undisturbed.result)


@pytest.mark.usefixtures("supervisor")
@SQLITE_ONLY
def test_training_with_damaged_files_goes_on_from_an_earlier_state(
    store: Store, tmp_path: Path
) -> None:
    job_id = train(store, **{"learning.total_steps": 3072})
    wait_for(store, job_id, lambda job: job.step >= 1152)
    (pid,) = worker_pids(os.getpid())
    os.kill(pid, signal.SIGSTOP)
    newest = attempts.load_resume(store, job_id)
    assert newest is not None
    last = newest.manifest["memory"][-1]["sha256"]
    (tmp_path / "resume" / job_id / f"{last}.safetensors").write_bytes(b"torn")
    os.kill(pid, signal.SIGKILL)
    job = wait_until_final(store, job_id)
    assert (job.state, job.error) == ("succeeded", None)
    assert [m.step for m in metrics.list_metrics(store, job_id)] == list(range(128, 3073, 128))
    resumed = [e.data.get("resumed_from_step") for e in events.list_events(store, job_id)]
    assert newest.step - 512 in resumed
    assert [step for step, _ in made_by(store, job_id).checkpoints] == list(
        range(3072, 0, -512)
    )


@SQLITE_ONLY
def test_training_in_a_cell_of_one_s_own_gives_a_policy_of_that_cell(
    store: Store, tmp_path: Path
) -> None:
    CellCatalog(store).add(workshop.cell())
    train(store, cell="workshop", **{"learning.total_steps": 1024})
    job = run_here(store, tmp_path)
    assert (job.state, job.error) == ("succeeded", None)
    assert job.result is not None
    record = checkpoints.get_checkpoint(store, job.result["checkpoint"])
    assert is_for(record.manifest, workshop.cell())


@SQLITE_ONLY
def test_training_in_a_cell_that_is_gone_fails_by_name(store: Store, tmp_path: Path) -> None:
    train(store, cell="kitchen")
    job = run_here(store, tmp_path)
    assert job.state == "failed"
    assert "overrides.cell = 'kitchen' is not a known work cell" in (job.error or "")


@pytest.mark.slow
@pytest.mark.usefixtures("supervisor")
@SQLITE_ONLY
def test_killed_training_goes_on_and_its_policy_can_be_evaluated(store: Store) -> None:
    job_id = train(store, **{"learning.total_steps": 8192})
    wait_for(store, job_id, lambda job: job.step >= 1152)
    (pid,) = worker_pids(os.getpid())
    os.kill(pid, signal.SIGKILL)
    job = wait_until_final(store, job_id)
    assert (job.state, job.attempt) == ("succeeded", 2)
    assert [m.step for m in metrics.list_metrics(store, job_id)] == list(range(128, 8193, 128))
    steps = [c.step for c in checkpoints.list_checkpoints(store, job_id=job_id).items]
    assert steps == list(range(8192, 0, -512))
    assert job.result is not None
    body = {"kind": "evaluate", "protocol": "pick-single", "episodes": 5, "seed": 3}
    spec = parse_spec({**body, "checkpoint": job.result["checkpoint"]}).new_job()
    found = wait_until_final(store, jobs.create_job(store, spec).id)
    assert found.result is not None
    assert (found.result["checkpoint"], found.result["episodes"]) == (
        spec.spec["checkpoint"],
        5,
    )


@SQLITE_ONLY
@pytest.mark.parametrize("named", [None, "pick"])  # evaluations of former versions named one
def test_protocol_without_policy_is_run_without_checkpoint(
    store: Store, tmp_path: Path, named: str | None
) -> None:
    body = {"kind": "evaluate", "protocol": "safety-ssm", "episodes": 2}
    new = parse_spec(body).new_job()
    new = replace(new, spec={**new.spec, "checkpoint": named})
    jobs.create_job(store, new)
    job = run_here(store, tmp_path)
    assert (job.state, job.error) == ("succeeded", None)
    assert job.result is not None and "checkpoint" not in job.result


@SQLITE_ONLY
def test_evaluation_of_an_unknown_checkpoint_fails_by_name(
    store: Store, tmp_path: Path
) -> None:
    body = {"kind": "evaluate", "protocol": "pick-single", "checkpoint": "nobody"}
    jobs.create_job(store, parse_spec(body).new_job())
    job = run_here(store, tmp_path)
    assert (job.state, job.error) == ("failed", "no checkpoint 'nobody'")


@SQLITE_ONLY
def test_evaluation_is_of_the_checkpoint_that_its_alias_named_when_it_was_posted(
    store: Store, tmp_path: Path
) -> None:
    for name in ("reach", "pick"):
        checkpoints.put_checkpoint(store, shipped(name))
    checkpoints.set_alias(store, "line-2", pretrained.SHA256["reach"])
    body = {"kind": "evaluate", "protocol": "pick-single", "checkpoint": "line-2"}
    jobs.create_job(store, parse_spec({**body, "episodes": 1}).new_job())
    checkpoints.set_alias(store, "line-2", pretrained.SHA256["pick"])
    ended = run_here(store, tmp_path)
    assert "must be a policy that picks" in (ended.error or "")


@pytest.mark.usefixtures("supervisor")
@SQLITE_ONLY
def test_evaluation_beside_stored_recordings_tells_row_by_row(store: Store) -> None:
    recordings = RecordingCatalog(store)
    for name, seed in (("nods", 0), ("waves", 1)):
        recordings.add(csv_text(working(100, seed=seed)).encode(), "clip.csv", name)
    policy = pretrained.load("pick")
    checkpoints.put_checkpoint(store, to_store(policy))
    body = {"kind": "evaluate", "protocol": "pick-mocap", "checkpoint": policy.sha256}
    spec = parse_spec({**body, "episodes": 4, "recordings": ["waves", "nods"]}).new_job()
    job = wait_until_final(store, jobs.create_job(store, spec).id)
    assert (job.state, job.error) == ("succeeded", None)
    assert job.result is not None
    names = [row["name"] for row in job.result["results"]]
    assert names == ["library", "recorded", "recorded nods", "recorded waves"]
    assert (job.step, job.total_steps) == (4, 4)
    points = metrics.list_metrics(store, job.id)
    assert [point.step for point in points] == [1, 2, 3, 4]
    for point, row in zip(points, job.result["results"], strict=True):
        assert point.values["success"] == row["success"]["mean"]


@SQLITE_ONLY
def test_evaluation_of_the_case_studies_tells_the_rates_of_each_case(
    store: Store, tmp_path: Path
) -> None:
    policy = pretrained.load("pick")
    checkpoints.put_checkpoint(store, to_store(policy))
    body = {"kind": "evaluate", "protocol": "pick-cases", "checkpoint": policy.sha256}
    spec = parse_spec({**body, "episodes": 2}).new_job()
    jobs.create_job(store, spec)
    job = run_here(store, tmp_path)
    assert (job.state, job.error, job.step) == ("succeeded", None, 4)
    assert job.result is not None
    points = metrics.list_metrics(store, job.id)
    for point, row in zip(points, job.result["results"], strict=True):
        assert point.values["success"] == row["success"]["mean"]
        assert "mean" not in row["expected"]  # what the case expects, no rate
        assert "expected" not in point.values


@SQLITE_ONLY
def test_evaluation_beside_a_recording_that_is_gone_fails_by_name(
    store: Store, tmp_path: Path
) -> None:
    policy = pretrained.load("pick")
    checkpoints.put_checkpoint(store, to_store(policy))
    body = {"kind": "evaluate", "protocol": "pick-mocap", "recordings": ["waves"]}
    spec = parse_spec({**body, "checkpoint": policy.sha256, "episodes": 4}).new_job()
    jobs.create_job(store, spec)
    job = run_here(store, tmp_path)
    assert job.state == "failed"
    assert "recordings[0] = 'waves' is not a stored recording" in (job.error or "")


@SQLITE_ONLY
def test_evaluation_of_sorting_tells_row_by_row_and_refuses_a_policy_that_picks(
    store: Store, tmp_path: Path
) -> None:
    ended = []
    for policy in (untrained(), pretrained.load("pick")):
        checkpoints.put_checkpoint(store, to_store(policy))
        body = {"kind": "evaluate", "protocol": "sorting-tests", "episodes": 2}
        spec = parse_spec({**body, "checkpoint": policy.sha256}).new_job()
        jobs.create_job(store, spec)
        ended.append(run_here(store, tmp_path))
    sorts, picks = ended
    assert (sorts.state, sorts.error, sorts.step) == ("succeeded", None, 12)
    assert sorts.result is not None
    assert len(metrics.list_metrics(store, sorts.id)) == len(sorts.result["results"]) == 12
    assert picks.state == "failed"
    assert "must be a policy that sorts for sorting-tests" in (picks.error or "")
