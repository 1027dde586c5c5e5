import csv
import io
from typing import Any

import numpy as np
import pytest

from app.errors import InvalidInput, NotFound
from app.store import attempts, checkpoints, completion, jobs, metrics
from app.store.engine import Store
from app.store.records import NewJob
from jobs.comparison import band, compare, curves_as_csv
from jobs.spec import TrainSpec, parse_spec
from tests.store.test_attempts import policy
from tests.support.databases import claimed


def trained(
    store: Store,
    seed: int,
    values: list[float | None],
    preset: str = "pick-td3",
    **changes: Any,
) -> str:
    """Add a training with a curve of a point every 10 steps."""
    overrides = {"learning": changes} if changes else {}
    spec = TrainSpec(kind="train", preset=preset, seed=seed, overrides=overrides)
    job = jobs.create_job(store, spec.new_job())
    found = claimed(store)
    for place, value in enumerate(values):
        attempts.record_progress(
            store, found[0], 10 * (place + 1), {"success": value, "reward": -1.0}
        )
    completion.finish(store, found[0])
    return job.id


def test_band_spans_the_jobs_that_have_reached_a_step() -> None:
    long, short = [(0, 0.0), (10, 1.0), (20, 2.0)], [(0, 2.0), (5, None), (10, 3.0)]
    mean, low, high, n = band([long, short], [0, 5, 10, 20, 30])
    assert mean.tolist()[:4] == [1.0, 1.5, 2.0, 2.0]
    assert low.tolist()[:4] == [0.0, 0.5, 1.0, 2.0]
    assert high.tolist()[:4] == [2.0, 2.5, 3.0, 2.0]
    assert n.tolist() == [2, 2, 2, 1, 0]
    assert np.isnan([mean[4], low[4], high[4]]).all()


def test_jobs_of_other_seeds_are_one_group_and_other_values_another(store: Store) -> None:
    a1 = trained(store, 1, [0.0, 0.4])
    a2 = trained(store, 2, [0.2, 0.8])
    b1 = trained(store, 1, [0.5, None], gamma=0.95)
    found = compare(store, [a1, b1, a2])
    assert (found.quantity, found.quantities) == ("success", ("success", "reward"))
    assert found.steps == (10, 20)
    assert [group.jobs for group in found.groups] == [(a1, a2), (b1,)]
    assert found.groups[0].mean == pytest.approx([0.1, 0.6])
    assert found.groups[0].high.tolist() == [0.2, 0.8]
    assert found.groups[1].label == "gamma 0.95"
    assert found.groups[1].n.tolist() == [1, 0]
    assert found.differences.keys() == {"learning.gamma", "seed"}
    assert found.differences["seed"] == (1, 1, 2)
    assert found.differences["learning.gamma"][1] == 0.95


def test_groups_that_a_preset_alone_does_not_tell_apart_have_the_numbers_of_jobs(
    store: Store,
) -> None:
    first, other = trained(store, 1, [0.1]), trained(store, 1, [0.2], gamma=0.95)
    third = trained(store, 1, [0.3], preset="sorting-e1-dqn")
    labels = [group.label for group in compare(store, [first, other, third]).groups]
    assert labels == ["pick-td3 (job 1)", "pick-td3 (job 2)", "sorting-e1-dqn"]


SWEEP = {
    "kind": "sweep",
    "preset": "pick-td3",
    "ranges": {"learning.gamma": {"low": 0.9, "high": 0.99}},
    "trials": 4,
    "objective": {"protocol": "pick-single", "quantity": "success"},
}
EVALUATE = {"kind": "evaluate", "protocol": "pick-single"}


@pytest.mark.parametrize(
    ("body", "change", "differing"),
    [
        (SWEEP, {"trials": 5}, {"trials"}),
        (
            SWEEP,
            {"ranges": {"learning.gamma": {"low": 0.8, "high": 0.99}}},
            {"ranges.learning.gamma.low"},
        ),
        (SWEEP, {"prune": True}, set()),
        (EVALUATE, {"seed": 0}, set()),
        (EVALUATE, {"seed": 1}, {"seed"}),
    ],
)
def test_fields_that_differ_are_those_with_another_effect(
    store: Store, body: dict[str, Any], change: dict[str, Any], differing: set[str]
) -> None:
    ids = [
        jobs.create_job(store, parse_spec({**body, **one}).new_job()).id for one in ({}, change)
    ]
    assert compare(store, ids).differences.keys() == differing


def test_evaluations_of_one_alias_differ_in_the_checkpoints_that_it_named(
    store: Store,
) -> None:
    ids, named = [], []
    for content in (b"1", b"2"):
        named.append(checkpoints.put_checkpoint(store, policy(content)).sha256)
        checkpoints.set_alias(store, "best", named[-1])
        spec = parse_spec({**EVALUATE, "checkpoint": "best"})
        ids.append(jobs.create_job(store, spec.new_job()).id)
    assert compare(store, ids).differences == {"checkpoint": tuple(named)}


def test_job_with_a_field_of_an_earlier_version_is_compared(store: Store) -> None:
    overrides = {"learning": {"gone": 1}}
    spec = {"kind": "train", "preset": "pick-td3", "overrides": overrides}
    new = NewJob(kind="train", preset="pick-td3", spec=spec, overrides=overrides)
    ids = [jobs.create_job(store, new).id, trained(store, 1, [])]
    assert compare(store, ids).differences["overrides.learning.gone"] == (1, None)


def test_override_that_equals_the_preset_is_no_difference(store: Store) -> None:
    plain = trained(store, 1, [0.1])
    gamma = compare(store, [plain, trained(store, 1, [], gamma=0.9)]).differences
    same = trained(store, 1, [0.1], gamma=gamma["learning.gamma"][0])
    found = compare(store, [plain, same])
    assert found.differences == {}
    assert len(found.groups) == 1


def test_evaluation_is_compared_by_its_fields_and_has_no_curve(store: Store) -> None:
    body = {"kind": "evaluate", "protocol": "pick-single", "episodes": 10}
    job = jobs.create_job(store, parse_spec(body).new_job())
    found = compare(store, [job.id, trained(store, 1, [])])
    assert (found.quantity, found.steps) == (None, ())
    assert len(found.groups) == 1
    assert found.differences["protocol"] == ("pick-single", None)


def test_bad_lists_of_jobs_are_refused(store: Store) -> None:
    job = trained(store, 1, [0.1])
    with pytest.raises(InvalidInput, match=r"job\[1\] = .* must be named once"):
        compare(store, [job, job])
    with pytest.raises(InvalidInput, match="1 to 20 jobs"):
        compare(store, [str(k) for k in range(21)])
    with pytest.raises(NotFound):
        compare(store, [job, "gone"])
    with pytest.raises(InvalidInput, match="choices: success, reward"):
        compare(store, [job], "luck")


def test_long_curves_are_thinned_evenly_and_keep_their_last_point(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(metrics, "MAX_POINTS", 3)
    long = trained(store, 1, [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7])
    short = trained(store, 2, [0.5, 0.6])
    rows = list(csv.DictReader(io.StringIO(curves_as_csv(store, [long, short]))))
    assert [(r["seed"], r["step"], r["success"]) for r in rows] == [
        ("1", "10", "0.1"),
        ("1", "40", "0.4"),
        ("1", "70", "0.7"),
        ("2", "10", "0.5"),
        ("2", "20", "0.6"),
    ]
    found = compare(store, [long, short])
    assert found.steps == (20, 70)
    assert found.groups[0].mean == pytest.approx([0.4, 0.7])
    assert found.groups[0].n.tolist() == [2, 1]


def test_csv_has_every_point_and_quantity(store: Store) -> None:
    first = trained(store, 1, [0.25, None])
    second = trained(store, 7, [0.5])
    rows = list(csv.DictReader(io.StringIO(curves_as_csv(store, [first, second]))))
    assert [(r["seed"], r["step"], r["success"], r["reward"]) for r in rows] == [
        ("1", "10", "0.25", "-1.0"),
        ("1", "20", "", "-1.0"),
        ("7", "10", "0.5", "-1.0"),
    ]
