"""Sweeps, looked at by a new server each time; their trials are ended by the test."""

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

import pytest
import sqlalchemy as sa

from app.errors import InvalidInput
from app.store import (
    attempts,
    completion,
    composed_jobs,
    job_actions,
    jobs,
    metrics,
    retention,
)
from app.store.database import tables
from app.store.engine import Store
from app.store.records import JobRecord, NewJob
from jobs.composed.sweeps import Sweeps, SweepTrial, trials_of
from jobs.spec import parse_spec
from tests.store.test_attempts import policy, resume
from tests.support.databases import SQLITE_ONLY, claimed

SWEEP: dict[str, Any] = {
    "kind": "sweep",
    "preset": "pick-td3",
    "seed": 3,
    "overrides": {"learning": {"total_steps": 128_000}},
    "ranges": {
        "learning.lr_start": {"low": 1e-4, "high": 1e-3, "log": True},
        "networks.width": {"choices": [64, 128]},
        "learning.n_steps": {"low": 1, "high": 5},
    },
    "trials": 4,
    "objective": {"protocol": "pick-single", "episodes": 10},
}


def post(store: Store, **changes: Any) -> JobRecord:
    return jobs.create_job(store, parse_spec({**SWEEP, **changes}).new_job())


def look(store: Store, sweep: JobRecord) -> tuple[JobRecord, tuple[SweepTrial, ...]]:
    """Let a server that has just started look at the sweeps."""
    Sweeps().advance(store)
    now = jobs.get_job(store, sweep.id)
    return now, trials_of(store, now)


def run_one(store: Store, success: float) -> JobRecord:
    """Run the next queued job to its end."""
    claim, job = claimed(store)
    if job.kind == "train":
        for step in (51_200, 102_400):
            attempts.record_progress(store, claim, step, {"success": success})
        completion.finish(store, claim, result={"checkpoint": "ab" * 32, "step": 128_000})
    else:
        rate = {"mean": success, "low": success - 0.1, "high": success + 0.1}
        row = {"name": "pick", "n": 10, "success": rate}
        completion.finish(store, claim, result={"results": [row]})
    return job


def run_trial(store: Store, sweep: JobRecord, success: float) -> None:
    look(store, sweep)
    assert run_one(store, success).kind == "train"
    look(store, sweep)
    assert run_one(store, success).kind == "evaluate"


def test_trials_are_trained_evaluated_and_compared(store: Store) -> None:
    sweep = post(store)
    for success in (0.2, 0.9, 0.4, 0.3):
        run_trial(store, sweep, success)
    job, trials = look(store, sweep)
    assert (job.state, job.step, job.total_steps) == ("succeeded", 4, 4)
    assert [one.state for one in trials] == ["succeeded"] * 4
    assert job.result is not None
    assert (job.result["trial"], job.result["value"]["mean"]) == (2, 0.9)
    assert job.result["parameters"] == trials[1].parameters
    assert [row.values["best"] for row in metrics.list_metrics(store, job.id)] == [
        0.2,
        0.9,
        0.9,
        0.9,
    ]
    for one in trials:
        drawn = one.parameters
        assert 1e-4 <= float(drawn["learning.lr_start"]) <= 1e-3
        assert drawn["networks.width"] in (64, 128)
        assert drawn["learning.n_steps"] in range(1, 6)
        assert one.training.seed == 3 and one.training.overrides["learning"]["total_steps"]
    assert len({str(one.parameters) for one in trials}) == 4


def test_so_many_trials_as_allowed_wait_at_once(store: Store) -> None:
    sweep = post(store, parallel=2)
    for _ in range(4):
        _, trials = look(store, sweep)
    assert [one.state for one in trials] == ["queued", "queued"]
    assert trials[0].parameters != trials[1].parameters


def test_training_below_the_median_is_pruned(store: Store) -> None:
    sweep = post(store, trials=6)
    for success in (0.8, 0.9, 0.7, 0.8):
        run_trial(store, sweep, success)
    look(store, sweep)
    found = claimed(store)
    attempts.record_progress(store, found[0], 51_200, {"success": 0.1})
    look(store, sweep)
    pruned = jobs.get_job(store, found[0].job_id)
    assert (pruned.state, pruned.ended_by) == ("cancelling", "pruned")
    completion.finish(store, found[0], state="cancelled")
    job, trials = look(store, sweep)
    assert (trials[4].state, trials[5].state, job.state) == ("pruned", "queued", "running")


def test_training_is_pruned_by_the_last_point_of_a_long_curve(store: Store) -> None:
    sweep = post(store, trials=6)
    for success in (0.8, 0.9, 0.7, 0.8):
        run_trial(store, sweep, success)
    look(store, sweep)
    claim, _ = claimed(store)
    point = {"job_id": claim.job_id, "values": {"success": 0.1}, "at": datetime.now(UTC)}
    points = [{**point, "step": step} for step in range(1, metrics.MAX_POINTS + 1)]
    with store.writing() as connection:
        connection.execute(sa.insert(tables.metrics), points)
    attempts.record_progress(store, claim, 51_200, {"success": 0.1})
    look(store, sweep)
    assert jobs.get_job(store, claim.job_id).ended_by == "pruned"


def test_sweep_ends_after_a_trial_that_was_resumed_beside_its_replacement(
    store: Store,
) -> None:
    sweep = post(store, trials=2, parallel=2)
    for _ in range(2):
        look(store, sweep)
    first, _ = claimed(store)
    attempts.record_checkpoint(store, first, 5, policy(b"1"), resume(5))
    jobs.request_cancel(store, first.job_id)
    completion.finish(store, first, state="cancelled")
    look(store, sweep)
    job_actions.resume_job(store, first.job_id)
    resumed, _ = claimed(store)
    assert resumed.job_id == first.job_id
    for kind in ("train", "evaluate"):
        assert [run_one(store, 0.2).kind for _ in range(2)] == [kind, kind]
        look(store, sweep)
    job, trials = look(store, sweep)
    assert (job.state, trials[0].state, job.step) == ("running", "running", 2)
    completion.finish(store, resumed, result={"checkpoint": "a" * 64})
    look(store, sweep)
    assert run_one(store, 0.9).kind == "evaluate"
    job, trials = look(store, sweep)
    assert [one.state for one in trials] == ["succeeded"] * 3
    assert (job.state, job.step, job.result and job.result["trial"]) == ("succeeded", 2, 1)


@pytest.mark.parametrize("state", ["succeeded", "failed"])
def test_training_that_ends_before_its_pruner_is_not_called_pruned(
    store: Store, state: str
) -> None:
    sweep = post(store, trials=2, parallel=2)
    for _ in range(2):
        look(store, sweep)
    for prunes_first in (True, False):
        found, _ = claimed(store)
        if prunes_first:
            composed_jobs.mark_pruned(store, found.job_id)
        if state == "succeeded":
            completion.finish(store, found, result={"checkpoint": "a" * 64})
        else:
            completion.fail(store, found, "no cell")
        composed_jobs.mark_pruned(store, found.job_id)
        ended = jobs.get_job(store, found.job_id)
        assert (ended.state, ended.ended_by) == (state, None)


def test_cancelled_sweep_ends_with_its_trials_and_goes_on_when_resumed(store: Store) -> None:
    sweep = post(store, trials=2)
    run_trial(store, sweep, 0.5)
    look(store, sweep)
    jobs.request_cancel(store, sweep.id)
    look(store, sweep)
    job, trials = look(store, sweep)
    assert (job.state, trials[1].state) == ("cancelled", "cancelled")
    assert job_actions.resume_job(store, sweep.id).state == "queued"
    run_trial(store, sweep, 0.6)
    job, trials = look(store, sweep)
    assert (job.state, [one.number for one in trials]) == ("succeeded", [1, 2, 3])


def test_cancelled_sweep_ends_while_the_queue_waits(store: Store) -> None:
    cancelled, other = post(store, trials=2), post(store, trials=2)
    look(store, cancelled)
    jobs.request_cancel(store, cancelled.id)
    for _ in range(2):
        Sweeps().advance(store, goes_on=False)
    assert jobs.get_job(store, cancelled.id).state == "cancelled"
    assert jobs.get_job(store, other.id).state == "running"


def test_sweep_ends_however_few_jobs_are_kept(store: Store) -> None:
    sweep = post(store, trials=3)
    for success in (0.2, 0.9, 0.4):
        run_trial(store, sweep, success)
        list(retention.prune(store, keep_jobs=1, keep_states=1, acting={}))
    job, trials = look(store, sweep)
    assert (job.state, [one.number for one in trials]) == ("succeeded", [1, 2, 3])


def test_evaluation_of_a_deleted_training_is_no_value_of_a_later_trial(store: Store) -> None:
    sweep = post(store, trials=3)
    run_trial(store, sweep, 0.9)
    jobs.request_cancel(store, sweep.id)
    _, trials = look(store, sweep)
    retention.delete_job(store, trials[0].training.id, {})
    job_actions.resume_job(store, sweep.id)
    look(store, sweep)
    run_one(store, 0.1)
    _, trials = look(store, sweep)
    assert [(one.number, one.state, one.value) for one in trials] == [(2, "evaluating", None)]


def test_sweep_without_any_value_fails_with_the_reason(store: Store) -> None:
    sweep = post(store, trials=2)
    for _ in range(2):
        look(store, sweep)
        found = claimed(store)
        completion.fail(store, found[0], "out of memory")
    job, _ = look(store, sweep)
    assert (job.state, job.error) == ("failed", "no trial has a value; trial 2: out of memory")


def test_sweep_whose_evaluation_lacks_the_row_ends_at_once(store: Store) -> None:
    objective = {**SWEEP["objective"], "row": "other"}
    sweep = post(store, trials=4, parallel=2, objective=objective)
    for _ in range(2):
        look(store, sweep)
    run_one(store, 0.5)
    second, _ = claimed(store)
    look(store, sweep)
    assert run_one(store, 0.5).kind == "evaluate"
    job, trials = look(store, sweep)
    rule = "no success in row 'other' of the evaluation, which has the rows pick"
    assert (job.state, len(trials)) == ("failed", 2)
    assert job.error == f"no trial can have a value; trial 1: {rule}"
    assert jobs.get_job(store, second.job_id).state == "cancelling"


def test_sweep_that_cannot_go_on_fails_alone(store: Store) -> None:
    damaged, taken, sound = (post(store) for _ in range(3))
    other = NewJob(kind="count", spec={"kind": "count"})
    jobs.create_job(store, other, idempotency_key=f"{taken.id}-1-train")
    put_spec(store, damaged, {})
    assert look(store, sound)[0].state == "running"
    reasons = {one.id: jobs.get_job(store, one.id).error for one in (damaged, taken)}
    assert "cannot go on" in str(reasons[damaged.id])
    assert "was submitted with another body" in str(reasons[taken.id])


def test_trial_that_is_queued_again_with_another_priority_is_the_same(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    sweep = post(store)
    _, (trial,) = look(store, sweep)
    job_actions.change_labels(store, sweep.id, {"priority": 5})
    with monkeypatch.context() as patch:  # a server that was paused after it had read the parts
        patch.setattr(composed_jobs, "parts_of", lambda *_: ())
        Sweeps().advance(store)
    job, trials = look(store, sweep)
    assert job.state == "running"
    assert [one.training.id for one in trials] == [trial.training.id]


def put_spec(store: Store, sweep: JobRecord, spec: Mapping[str, Any]) -> None:
    """Change the stored spec of a sweep; an empty one is damaged."""
    with store.writing() as connection:
        mine = tables.jobs.c.id == sweep.id
        connection.execute(sa.update(tables.jobs).where(mine).values(spec=dict(spec)))


def test_failed_sweep_cancels_its_trials_and_replaces_them_when_resumed(store: Store) -> None:
    sweep = post(store, trials=2, parallel=2)
    for _ in range(2):
        look(store, sweep)
    running, _ = claimed(store)
    put_spec(store, sweep, {})
    Sweeps().advance(store)
    first, second = composed_jobs.parts_of(store, sweep.id)
    assert jobs.get_job(store, sweep.id).state == "failed"
    assert (first.state, second.state) == ("cancelling", "cancelled")
    put_spec(store, sweep, sweep.spec)
    job_actions.resume_job(store, sweep.id)
    for _ in range(2):
        _, trials = look(store, sweep)
    assert [one.state for one in trials] == ["running", "cancelled", "queued"]
    completion.finish(store, running, state="cancelled")
    _, trials = look(store, sweep)
    assert [one.state for one in trials] == ["cancelled", "cancelled", "queued", "queued"]


def test_cancel_of_a_sweep_that_waits_cancels_its_trials(store: Store) -> None:
    sweep = post(store, trials=2)
    look(store, sweep)
    claim, _ = claimed(store)
    attempts.record_checkpoint(store, claim, 5, policy(b"1"), resume(5))
    completion.fail(store, claim, "no cell")
    put_spec(store, sweep, {})
    Sweeps().advance(store)
    put_spec(store, sweep, sweep.spec)
    job_actions.resume_job(store, claim.job_id)
    job_actions.resume_job(store, sweep.id)
    assert jobs.request_cancel(store, sweep.id).state == "cancelled"
    assert jobs.get_job(store, claim.job_id).state == "cancelled"


@SQLITE_ONLY
def test_sweep_is_no_work_for_a_worker_and_outlives_its_server(store: Store) -> None:
    sweep = post(store)
    assert attempts.claim_next(store) is None
    look(store, sweep)
    assert attempts.running_jobs(store) == []
    assert completion.requeue_orphans(store) == ()
    assert [one.id for one in composed_jobs.open_jobs(store, "sweep")] == [sweep.id]


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"ranges": {"learning.gama": {"low": 0, "high": 1}}}, "ranges.learning.gama"),
        (
            {"ranges": {"learning.gamma": {"low": 0.9, "high": 2.0}}},
            "ranges.learning.gamma.high",
        ),
        ({"ranges": {"learning.gamma": {"low": 0.9}}}, "ranges.learning.gamma.high"),
        (
            {"ranges": {"learning.gamma": {"low": 0.99, "high": 0.9}}},
            "ranges.learning.gamma.high",
        ),
        (
            {"ranges": {"learning.target_noise": {"low": 0.0, "high": 0.1, "log": True}}},
            "ranges.learning.target_noise.low",
        ),
        (
            {"ranges": {"networks.width": {"choices": [64, 3]}}},
            "ranges.networks.width.choices[1]",
        ),
        (
            {"ranges": {"networks.width": {"choices": [64, 128, 64]}}},
            "ranges.networks.width.choices[2]",
        ),
        (
            {"ranges": {"networks.width": {"choices": [64, 65], "low": 1}}},
            "ranges.networks.width.choices",
        ),
        ({"objective": {"protocol": "reach-random"}}, "objective.protocol"),
        ({"objective": {"protocol": "pick-single", "episodes": 10**6}}, "objective.episodes"),
        ({"preset": "pick-td4"}, "preset"),
        ({"overrides": {"learning": {"gamma": 2.0}}}, "overrides.learning.gamma"),
    ],
)
def test_bad_sweep_is_refused_by_field(changes: dict[str, Any], field: str) -> None:
    with pytest.raises(InvalidInput) as refused:
        parse_spec({**SWEEP, **changes}).new_job()
    assert refused.value.field == field


@pytest.mark.parametrize("is_deleted", [False, True])
def test_sweep_that_is_cancelled_after_it_was_read_starts_nothing(
    store: Store, monkeypatch: pytest.MonkeyPatch, is_deleted: bool
) -> None:
    sweep = post(store)
    jobs.request_cancel(store, sweep.id)
    if is_deleted:
        retention.delete_job(store, sweep.id, {})
    with monkeypatch.context() as patch:  # a server that has read it before
        patch.setattr(composed_jobs, "open_jobs", lambda *_: (sweep,))
        Sweeps().advance(store)
    assert jobs.list_jobs(store, part_of=sweep.id).items == ()
    assert attempts.claim_next(store) is None
