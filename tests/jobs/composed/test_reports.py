"""Reports, looked at by a new server each time; their evaluations are ended by the test."""

from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa

from app.errors import InvalidInput, WrongState
from app.policies.report.page import RESULTS, evaluations, page
from app.store import (
    attempts,
    completion,
    composed_jobs,
    events,
    job_actions,
    jobs,
    metrics,
    retention,
)
from app.store.database import tables
from app.store.engine import Store
from app.store.records import JobRecord
from jobs.composed import reports
from jobs.composed.reports import Reports
from jobs.spec import parse_spec
from tests.support.databases import claimed


def post(store: Store, **changes: Any) -> JobRecord:
    return jobs.create_job(store, parse_spec({"kind": "report", **changes}).new_job())


def look(store: Store, report: JobRecord) -> JobRecord:
    """Let a server that has just started look at the reports."""
    Reports().advance(store)
    return jobs.get_job(store, report.id)


def parts_of(store: Store, report: JobRecord) -> list[JobRecord]:
    return list(jobs.list_jobs(store, part_of=report.id, limit=200).items)[::-1]


def run_one(store: Store) -> JobRecord:
    """Run the next queued evaluation; each states a success of 12.34 %."""
    claim, job = claimed(store)
    rate = {"mean": 0.1234, "low": 0.1, "high": 0.2}
    rows = [{"name": name, "n": 7, "success": rate} for name in ("interpolated", "critic")]
    result = {"protocol": job.spec["protocol"], "seed": 5, "episodes": 7, "results": rows}
    completion.finish(store, claim, result=result)
    return job


def test_report_of_stored_results_is_the_page_of_the_command(store: Store) -> None:
    report = look(store, post(store, priority=3))
    assert report.state == "succeeded" and not parts_of(store, report)
    assert report.result is not None
    assert (report.result["markdown"], report.result["missing"]) == page(RESULTS)


def test_report_without_the_folder_of_stored_results_fails(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reports, "RESULTS", tmp_path / "none")
    report = look(store, post(store))
    assert report.state == "failed" and report.error is not None
    assert "none' must be a folder of result files" in report.error


def test_evaluations_are_queued_a_few_at_once_and_fill_the_page(store: Store) -> None:
    report = post(store, measure=True, episodes=300, parallel=2, seed=5, priority=4)
    assert report.total_steps == len(evaluations())
    assert look(store, report).state == "running"
    first, second = parts_of(store, report)
    assert (first.priority, first.seed, first.spec["episodes"]) == (4, 5, 300)
    assert look(store, report).step == 0 and len(parts_of(store, report)) == 2
    for done in range(1, len(evaluations()) + 1):
        assert run_one(store).part_of == report.id
        assert look(store, report).step == done
    asked = [(one.spec["protocol"], one.spec["checkpoint"]) for one in parts_of(store, report)]
    assert asked == list(evaluations().values())
    ended = look(store, report)
    assert ended.state == "succeeded" and ended.result is not None
    assert ended.result["measured"] == len(evaluations())
    assert "12.34 % (10.00-20.00)" in ended.result["markdown"]
    assert f"job {second.number}: `python -m app evaluate" in ended.result["markdown"]
    oracle = [one.spec["episodes"] for one in parts_of(store, report)]
    assert max(oracle) == 300


def test_evaluation_that_is_queued_again_with_another_priority_is_the_same(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    report = look(store, post(store, measure=True))
    parts = parts_of(store, report)
    job_actions.change_labels(store, report.id, {"priority": 5})
    with monkeypatch.context() as patch:  # a server that was paused after it had read the parts
        patch.setattr(composed_jobs, "parts_of", lambda *_: ())
        Reports().advance(store)
    assert look(store, report).state == "running"
    assert parts_of(store, report) == parts


def test_evaluation_without_a_result_is_named_and_not_replaced_by_a_stored_one(
    store: Store,
) -> None:
    report = look(store, post(store, measure=True, parallel=8))
    while report.state == "running":
        found = attempts.claim_next(store)
        if found is not None:
            completion.fail(store, found[0], "no luck")
        report = look(store, report)
    assert report.result is not None
    assert report.result["failed"] == list(evaluations())
    assert "success" in report.result["markdown"]
    assert "`docs/results/reach-random.json`" not in report.result["markdown"]


def test_report_with_failed_evaluations_repeats_these_when_resumed(store: Store) -> None:
    report = look(store, post(store, measure=True))
    claim, failed = claimed(store)
    completion.fail(store, claim, "no luck")
    while look(store, report).state == "running":
        run_one(store)
    report = jobs.get_job(store, report.id)
    assert (report.state, report.ended_by) == ("succeeded", "failed parts")
    with pytest.raises(WrongState, match="retry job 1: resume it"):
        job_actions.require_repeatable(report, "retry")
    job_actions.resume_job(store, report.id)
    report = look(store, report)
    assert (report.state, report.step) == ("running", len(evaluations()) - 1)
    again = parts_of(store, report)[-1]
    assert (again.state, again.spec) == ("queued", failed.spec)
    run_one(store)
    report = look(store, report)
    assert (report.state, report.ended_by) == ("succeeded", None)
    assert report.result is not None
    assert (report.result["failed"], report.result["measured"]) == ([], len(evaluations()))
    points = [point.step for point in metrics.list_metrics(store, report.id)]
    assert points == sorted(set(points)) and points[-1] == report.step == len(evaluations())
    found = events.list_events(store, report.id)
    assert [one.data["step"] for one in found if one.kind == "progress"] == points
    revoked = [one.data.get("resumed_from_step") for one in found if one.kind == "state"]
    assert len(evaluations()) - 2 in revoked
    with pytest.raises(WrongState, match="resume job 1: clone it"):
        job_actions.resume_job(store, report.id)


def test_cancelled_report_continues_with_what_it_has_when_resumed(store: Store) -> None:
    report = post(store, measure=True)
    look(store, report)
    kept = run_one(store)
    look(store, report)
    jobs.request_cancel(store, report.id)
    assert look(store, report).state == "cancelling"
    assert look(store, report).state == "cancelled"
    assert [one.state for one in parts_of(store, report)] == ["succeeded", "cancelled"]
    job_actions.resume_job(store, report.id)
    assert look(store, report).state == "running"
    repeated = parts_of(store, report)
    assert [one.state for one in repeated] == ["succeeded", "cancelled", "queued"]
    assert repeated[2].spec == repeated[1].spec != kept.spec


def test_failed_report_cancels_its_evaluations_and_repeats_them_when_resumed(
    store: Store,
) -> None:
    report = look(store, post(store, measure=True))
    running, _ = claimed(store)
    with store.writing() as connection:
        mine = tables.jobs.c.id == report.id
        connection.execute(sa.update(tables.jobs).where(mine).values(spec={}))
    assert look(store, report).state == "failed"
    assert [one.state for one in parts_of(store, report)] == ["cancelling"]
    completion.finish(store, running, state="cancelled")
    with store.writing() as connection:
        connection.execute(sa.update(tables.jobs).where(mine).values(spec=dict(report.spec)))
    job_actions.resume_job(store, report.id)
    look(store, report)
    assert [one.state for one in parts_of(store, report)] == ["cancelled", "queued"]


@pytest.mark.parametrize(
    "changes", [{"episodes": 5}, {"measure": True, "episodes": 10**6}, {"parallel": 0}]
)
def test_spec_outside_its_limits_is_refused(changes: dict[str, Any]) -> None:
    with pytest.raises((InvalidInput, ValueError), match=r"episodes|parallel"):
        parse_spec({"kind": "report", **changes}).new_job()


@pytest.mark.parametrize("is_deleted", [False, True])
def test_report_that_is_cancelled_after_it_was_read_starts_nothing(
    store: Store, monkeypatch: pytest.MonkeyPatch, is_deleted: bool
) -> None:
    report = post(store, measure=True)
    jobs.request_cancel(store, report.id)
    if is_deleted:
        retention.delete_job(store, report.id, {})
    with monkeypatch.context() as patch:  # a server that has read it before
        patch.setattr(composed_jobs, "open_jobs", lambda *_: (report,))
        Reports().advance(store)
    assert jobs.list_jobs(store, part_of=report.id).items == ()
    assert attempts.claim_next(store) is None
