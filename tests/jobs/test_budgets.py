"""Budgets: a job ends at one, keeps its state, and ends like any other once it has a larger."""

import pytest

from app.errors import InvalidInput, WrongState
from app.store import job_actions, jobs
from app.store.engine import Store
from jobs.spec import parse_spec
from jobs.supervisor import Supervisor
from tests.jobs.machinery import assert_counted_once, queue, wait_for, wait_until_final
from tests.support.trainings import made_by

TRAIN = {"kind": "train", "preset": "pick-td3", "seed": 1}


def test_job_ends_at_the_first_point_beyond_its_steps_and_goes_on_with_more(
    store: Store, supervisor: Supervisor
) -> None:
    job_id = queue(store, steps=100, budgets={"step_budget": 42})
    supervisor.wake()
    job = wait_until_final(store, job_id)
    assert (job.state, job.ended_by, job.step, job.error) == (
        "succeeded",
        "step budget",
        45,
        None,
    )
    assert job_actions.resume_steps(store, [job_id]) == {job_id: 45}
    with pytest.raises(InvalidInput, match="step_budget = 42 must be above the 45 steps"):
        job_actions.resume_job(store, job_id)
    resumed = job_actions.resume_job(store, job_id, {"step_budget": None})
    assert (resumed.state, resumed.ended_by, resumed.result) == ("queued", None, None)
    job = wait_until_final(store, job_id)
    assert (job.state, job.ended_by, job.attempt) == ("succeeded", None, 2)
    assert job_actions.resume_steps(store, [job_id]) == {}
    found = [step for step, _ in made_by(store, job_id).checkpoints]
    assert found == [100, 80, 60, 45, 40, 20]


def test_step_budget_beyond_the_last_step_ends_nothing(
    store: Store, supervisor: Supervisor
) -> None:
    job_id = queue(store, steps=40, budgets={"step_budget": 40, "time_budget_s": 1e6})
    supervisor.wake()
    assert wait_until_final(store, job_id).ended_by is None
    assert_counted_once(store, job_id, steps=40)


def test_job_ends_with_its_time_of_all_attempts(store: Store, supervisor: Supervisor) -> None:
    job_id = queue(store, steps=100, hold_at=[33, 53], budgets={"time_budget_s": 0.2})
    supervisor.wake()
    job = wait_until_final(store, job_id)
    assert (job.state, job.ended_by) == ("succeeded", "time budget")
    assert job.run_s >= 0.2
    with pytest.raises(InvalidInput, match="time_budget_s = 0.2 must be above"):
        job_actions.resume_job(store, job_id, {"step_budget": 90})
    job_actions.resume_job(store, job_id, {"time_budget_s": job.run_s + 0.2})
    again = wait_until_final(store, job_id)
    assert again.ended_by == "time budget" and again.run_s >= job.run_s + 0.2
    with pytest.raises(WrongState, match="must not be succeeded to change a budget"):
        job_actions.change_labels(store, job_id, {"step_budget": 90})


def test_budget_of_a_running_job_is_changed(store: Store, supervisor: Supervisor) -> None:
    job_id = queue(store, steps=100, hold_at=[33])
    supervisor.wake()
    job = wait_for(store, job_id, lambda job: job.step == 30)
    with pytest.raises(InvalidInput, match="step_budget = 30 must be above the 30 steps"):
        job_actions.change_labels(store, job_id, {"step_budget": 30})
    job_actions.change_labels(store, job_id, {"time_budget_s": job.run_s + 0.1})
    job = wait_until_final(store, job_id)
    assert (job.state, job.ended_by) == ("succeeded", "time budget")


def test_budgets_are_no_part_of_the_spec() -> None:
    new = parse_spec({**TRAIN, "step_budget": 1000, "time_budget_s": 60}).new_job()
    assert (new.step_budget, new.time_budget_s) == (1000, 60.0)
    assert new.spec == TRAIN


def test_job_without_budgets_has_none(store: Store) -> None:
    job = jobs.create_job(store, parse_spec(TRAIN).new_job())
    assert (job.step_budget, job.time_budget_s, job.run_s, job.ended_by) == (
        None,
        None,
        0.0,
        None,
    )
