"""The same idempotency key: the same job for the same body, a conflict for any other."""

from typing import Any

import pytest
import sqlalchemy as sa

from app.errors import Conflict
from app.store import job_actions, jobs
from app.store.database import tables
from app.store.engine import Store
from app.store.records import JobRecord
from jobs.spec import SPEC_TYPES, parse_spec
from tests.jobs.composed.test_sweeps import SWEEP

LABELS: dict[str, Any] = {"name": "second", "notes": "slow", "priority": 3}
BODIES: dict[str, dict[str, Any]] = {
    "train": {"preset": "pick-td3"},
    "evaluate": {"protocol": "reach-ssm", "recordings": ["wave"]},
    "sweep": SWEEP,
    "report": {"measure": True},
}
CHANGES: dict[str, dict[str, Any]] = {
    "train": {
        "preset": "reach-td3",
        "seed": 1,
        "overrides": {"learning": {"gamma": 0.97}},
        "step_budget": 1000,
        "time_budget_s": 5.5,
        **LABELS,
    },
    "evaluate": {
        "protocol": "pick-mocap",
        "checkpoint": "own",
        "episodes": 10,
        "seed": 1,
        "recordings": ["walk"],
        **LABELS,
    },
    "sweep": {
        "preset": "pick-td3-monitored",
        "seed": 1,
        "overrides": {},
        "ranges": {"learning.gamma": {"low": 0.9, "high": 0.99}},
        "trials": 3,
        "parallel": 2,
        "prune": False,
        "objective": {"protocol": "pick-choice"},
        **LABELS,
    },
    "report": {"measure": False, "episodes": 10, "seed": 1, "parallel": 2, **LABELS},
}
MEMBERS = [
    pytest.param(kind, member, id=f"{kind}-{member}")
    for kind in BODIES
    for member in SPEC_TYPES[kind].model_fields
    if member != "kind"
]


def post(store: Store, kind: str, **changes: Any) -> JobRecord:
    new = parse_spec({**BODIES[kind], **changes, "kind": kind}).new_job()
    return jobs.create_job(store, new, idempotency_key="k")


@pytest.mark.parametrize(("kind", "member"), MEMBERS)
def test_same_key_with_one_member_changed_is_a_conflict(
    store: Store, kind: str, member: str
) -> None:
    first = post(store, kind)
    with pytest.raises(Conflict, match=f"belongs to job {first.id}, which was submitted with"):
        post(store, kind, **{member: CHANGES[kind][member]})
    assert post(store, kind).id == first.id
    assert len(jobs.list_jobs(store).items) == 1


@pytest.mark.parametrize(("kind", "member"), MEMBERS)
def test_same_body_is_the_same_job_with_each_member(
    store: Store, kind: str, member: str
) -> None:
    change = {member: CHANGES[kind][member]}
    assert post(store, kind, **change).id == post(store, kind, **change).id


def test_same_body_is_the_same_job_after_its_labels_and_budgets_were_changed(
    store: Store,
) -> None:
    first = post(store, "train", name="first", step_budget=500)
    changes = LABELS | {"step_budget": None, "time_budget_s": 60.0}
    job_actions.change_labels(store, first.id, changes)
    assert post(store, "train", name="first", step_budget=500).id == first.id
    with pytest.raises(Conflict):
        post(store, "train", **LABELS, time_budget_s=60.0)


def test_empty_label_and_whole_number_of_seconds_are_the_same_body(store: Store) -> None:
    first = post(store, "train", name=" a ", notes="", time_budget_s=5)
    assert post(store, "train", name="a", priority=0, time_budget_s=5.0).id == first.id


def test_job_from_before_digests_of_submissions_is_compared_by_its_spec(store: Store) -> None:
    first = post(store, "train")
    with store.writing() as connection:
        connection.execute(sa.update(tables.jobs).values(submission_digest=None))
    assert post(store, "train", name="second").id == first.id
    with pytest.raises(Conflict):
        post(store, "train", seed=1)
