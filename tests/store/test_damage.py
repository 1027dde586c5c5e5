"""Damaged rows are named and never used; everything else stays readable."""

import logging
import random
from collections.abc import Callable
from pathlib import Path

import pytest
import sqlalchemy as sa
from alembic import command

from app.digests import digest
from app.errors import Damaged, NotFound
from app.storage_errors import StorageUnavailable
from app.store import attempts, cells, checkpoints, completion, jobs, metrics, recordings
from app.store.database.migrate import alembic_config, migrate
from app.store.engine import Store
from app.store.records import Claim, NewCheckpoint, NewJob, NewRecording, ResumeState
from tests.store.test_attempts import claim_again
from tests.support.damage import JSON, TENSORS, Change, cut, damage, flip
from tests.support.databases import SQLITE_ONLY, claimed

pytestmark = SQLITE_ONLY  # PostgreSQL's files are not ours to damage

CONTENT = random.Random(1).randbytes(5000)
DEFINITION = {"table": {"size": [1.0, 2.0]}, "n": 1}
WAVE = NewRecording(
    name="wave",
    sha256="a" * 64,
    file_name="wave.bvh",
    n_runs=2,
    n_frames=250,
    duration=4.98,
    summary={"unit": "cm", "n": 1},
    detail={"artifacts": [], "n": 1},
    tensors=CONTENT,
)


def policy(seed: int = 1) -> NewCheckpoint:
    manifest = {"seed": 1, "preset": {"n": seed}}
    return NewCheckpoint(sha256=digest(manifest, CONTENT), manifest=manifest, tensors=CONTENT)


def harm(store: Store, table: str, column: str, change: Change, row: str = "1") -> None:
    assert store.sqlite_path is not None
    damage(store.sqlite_path, table, column, row, change)


def every(kinds: dict[str, dict[str, Change]]) -> list[pytest.param]:  # type: ignore[valid-type]
    return [
        pytest.param(column, change, id=f"{column}: {name}")
        for column, changes in kinds.items()
        for name, change in changes.items()
    ]


@pytest.mark.parametrize(
    ("column", "change"),
    every({"tensors": TENSORS, "manifest": JSON, "sha256": {"bit": flip(9)}}),
)
@pytest.mark.parametrize("alias", [True, False])
def test_damaged_checkpoint_is_named_until_it_is_stored_again(
    store: Store, column: str, change: Change, alias: bool
) -> None:
    sound = checkpoints.put_checkpoint(store, policy(seed=2))
    new = policy()
    checkpoints.put_checkpoint(store, new)
    if alias:
        checkpoints.set_alias(store, "mine", new.sha256)
    harm(store, "checkpoints", column, change, f"sha256 = '{new.sha256}'")
    name = "mine" if alias else new.sha256
    with pytest.raises((Damaged, NotFound)) as refused:
        checkpoints.read_checkpoint(store, name)
    if alias or column != "sha256":
        assert isinstance(refused.value, Damaged)
        assert (refused.value.name, refused.value.sha256) == (name, new.sha256)
    assert len(checkpoints.list_checkpoints(store).items) == 2
    found = [error for error in checkpoints.find_damaged(store) if error is not None]
    assert found and all(isinstance(error, Damaged) for error in found)
    assert checkpoints.read_checkpoint(store, sound.sha256)[1] == CONTENT
    checkpoints.put_checkpoint(store, new)
    record, tensors = checkpoints.read_checkpoint(store, name)
    assert (record.manifest, tensors) == (new.manifest, new.tensors)


def test_alias_of_nothing_is_damaged(store: Store) -> None:
    new = checkpoints.put_checkpoint(store, policy())
    checkpoints.set_alias(store, "mine", new.sha256)
    assert store.sqlite_path is not None
    damage(store.sqlite_path, "aliases", "sha256", "name = 'mine'", flip(0))
    with pytest.raises(Damaged, match="checkpoint 'mine' is damaged"):
        checkpoints.read_checkpoint(store, "mine")
    assert checkpoints.read_checkpoint(store, new.sha256)


@pytest.mark.parametrize("change", JSON.values(), ids=JSON)
def test_damaged_cell_is_named_and_can_be_stored_again(store: Store, change: Change) -> None:
    cells.put_cell(store, "sound", DEFINITION)
    cells.put_cell(store, "mine", DEFINITION)
    harm(store, "cells", "definition", change, "name = 'mine'")
    with pytest.raises(Damaged, match="cell 'mine' is damaged.*post its file again"):
        cells.get_cell(store, "mine")
    assert [one.name for one in cells.list_cells(store)] == ["sound"]
    cells.remove_cell(store, "mine")
    assert cells.put_cell(store, "mine", DEFINITION)
    assert cells.get_cell(store, "mine").definition == DEFINITION


@pytest.mark.parametrize(
    ("column", "change"), every({"tensors": TENSORS, "summary": JSON, "detail": JSON})
)
def test_damaged_recording_is_named_and_can_be_stored_again(
    store: Store, column: str, change: Change
) -> None:
    recordings.put_recording(store, WAVE)
    harm(store, "recordings", column, change)
    with pytest.raises(Damaged, match="recording 'wave' is damaged.*import its file again"):
        recordings.read_runs(store, "wave")
    shown = [one.name for one in recordings.list_recordings(store)]
    assert shown == ([] if column == "summary" else ["wave"])
    recordings.remove_recording(store, "wave")
    assert recordings.put_recording(store, WAVE)
    assert recordings.read_runs(store, "wave")[1] == CONTENT


def train_on(store: Store, claim: Claim, *steps: int) -> None:
    for step in steps:
        attempts.record_progress(store, claim, step, {"reward": float(step)})
        state = ResumeState(step=step, manifest={"n": 1}, tensors=CONTENT + bytes([step]))
        attempts.record_checkpoint(store, claim, step, policy(step), state)


@pytest.mark.parametrize(("column", "change"), every({"tensors": TENSORS, "manifest": JSON}))
def test_training_goes_on_from_the_state_before_a_damaged_one(
    store: Store, claim: Claim, caplog: pytest.LogCaptureFixture, column: str, change: Change
) -> None:
    train_on(store, claim, 10, 20, 30)
    harm(store, "resume_states", column, change, "step = 30")
    with caplog.at_level(logging.WARNING):
        again = claim_again(store)
    assert f"job {claim.job_id}: its state at step 30 is damaged" in caplog.text
    resume = attempts.load_resume(store, claim.job_id)
    assert resume is not None and (resume.step, resume.tensors) == (20, CONTENT + bytes([20]))
    assert [row.step for row in metrics.list_metrics(store, claim.job_id)] == [10, 20]
    assert jobs.get_job(store, claim.job_id).step == 20
    train_on(store, again, 30)
    found = attempts.load_resume(store, claim.job_id)
    assert found is not None and found.step == 30


def test_training_without_an_undamaged_state_starts_afresh(store: Store, claim: Claim) -> None:
    train_on(store, claim, 10, 20)
    for step in (10, 20):
        harm(store, "resume_states", "tensors", cut, f"step = {step}")
    claim_again(store)
    assert attempts.load_resume(store, claim.job_id) is None
    assert metrics.list_metrics(store, claim.job_id) == ()
    assert jobs.get_job(store, claim.job_id).step == 0


def test_two_states_of_a_training_are_kept_and_none_of_an_ended_one(
    store: Store, claim: Claim
) -> None:
    kept = sa.text("SELECT step FROM resume_states ORDER BY step")
    train_on(store, claim, 10, 20, 30, 40)
    with store.reading() as connection:
        assert connection.execute(kept).scalars().all() == [30, 40]
    completion.finish(store, claim)
    with store.reading() as connection:
        assert connection.execute(kept).scalars().all() == []


@pytest.mark.parametrize("column", ["spec", "overrides"])
@pytest.mark.parametrize("change", [JSON["cut"], JSON["a bit that leaves UTF-8"]])
def test_damaged_job_keeps_no_other_from_being_read(
    store: Store, claim: Claim, column: str, change: Change
) -> None:
    harm(store, "jobs", column, lambda content: change(b'{"a": "bcdefgh"}'))
    assert jobs.get_job(store, claim.job_id).id == claim.job_id
    assert len(jobs.list_jobs(store).items) == 1


@pytest.mark.parametrize("change", [JSON["cut"], JSON["a bit that leaves UTF-8"]])
def test_damaged_result_keeps_no_other_evaluation_from_being_selected(
    store: Store, change: Change
) -> None:
    ended = []
    for _ in range(2):
        jobs.create_job(store, NewJob(kind="evaluate", spec={}))
        claim, _job = claimed(store)
        completion.finish(store, claim, result={"protocol": "pick-single"})
        ended.append(claim.job_id)
    harm(store, "jobs", "result", change, f"id = '{ended[0]}'")
    found = jobs.list_evaluations(store, protocol="pick-single").items
    assert [job.id for job in found] == [ended[1]]


@pytest.mark.parametrize("change", [cut, flip(4, 6), flip(1, 7), lambda _: b""])
def test_damaged_times_keep_no_list_from_being_read(
    store: Store, claim: Claim, change: Change
) -> None:
    checkpoints.put_checkpoint(store, policy())
    cells.put_cell(store, "mine", DEFINITION)
    recordings.put_recording(store, WAVE)
    for table in ("jobs", "checkpoints", "cells", "recordings"):
        harm(store, table, "created_at", change)
    assert len(checkpoints.list_checkpoints(store).items) == 1
    assert len(jobs.list_jobs(store).items) == 1
    assert len(cells.list_cells(store)) == len(recordings.list_recordings(store)) == 1
    assert checkpoints.read_checkpoint(store, policy().sha256)[1] == CONTENT
    assert jobs.get_job(store, claim.job_id).created_at.tzinfo is not None


def garbage(path: Path, page: int) -> None:
    with path.open("r+b") as file:
        file.seek(4096 * page)
        file.write(random.Random(page).randbytes(4096))


@pytest.mark.parametrize("read", [checkpoints.list_checkpoints, jobs.list_jobs])
def test_pages_that_are_no_database_are_storage_that_cannot_be_used(
    store: Store, claim: Claim, read: Callable[[Store], object]
) -> None:
    train_on(store, claim, 10)
    path = store.sqlite_path
    assert path is not None
    store.close()
    for page in range(1, path.stat().st_size // 4096):
        garbage(path, page)
    with pytest.raises(StorageUnavailable, match="malformed"):
        read(store)


def test_what_an_older_version_stored_counts_as_undamaged(store: Store, claim: Claim) -> None:
    cells.put_cell(store, "mine", DEFINITION)
    recordings.put_recording(store, WAVE)
    train_on(store, claim, 10, 20)
    config = alembic_config()
    with store.writing() as connection:
        config.attributes["connection"] = connection
        command.downgrade(config, "0003")
        names = {one["name"] for one in sa.inspect(connection).get_columns("cells")}
        assert "digest" not in names
    migrate(store)
    assert cells.get_cell(store, "mine").definition == DEFINITION
    assert recordings.read_runs(store, "wave")[1] == CONTENT
    resume = attempts.load_resume(store, claim.job_id)
    assert resume is not None and resume.step == 20
