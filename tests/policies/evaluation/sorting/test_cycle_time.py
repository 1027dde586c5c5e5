"""Parts per hour of a sorting cell: the estimate, its interval, and the rows."""

import numpy as np
import pytest

from app.policies.checkpoints import pretrained
from app.policies.evaluation.registry import default_checkpoint, evaluate
from app.policies.evaluation.sorting import people
from app.policies.evaluation.sorting.cycle_time import STRAIGHT
from app.policies.evaluation.sorting.full_tasks import FullTasks
from app.policies.evaluation.sorting.order_rules import nearest
from app.policies.evaluation.sorting.people import SortingBesidePeople, parts_of
from app.policies.evaluation.statistics import mean_of


def tasks_of(parts: list[int], seconds: list[float]) -> FullTasks:
    none = np.zeros(len(parts), dtype=np.int64)
    return FullTasks(
        finished=np.array(seconds) < 600.0,
        cycle_s=np.array(seconds),
        moving=none,
        resting=none,
        stopped=none.astype(float),
        parts=np.array(parts),
        attempts=none,
        late=none,
        options=none,
    )


def test_throughput_is_the_ratio_of_all_parts_to_the_whole_time() -> None:
    runs = tasks_of([10, 10, 4], [100.0, 200.0, 600.0])
    found = mean_of(runs.throughput())
    assert found is not None
    assert found["mean"] == pytest.approx(24 / 900.0 * 3600.0)
    # Delta method by hand: parts less rate times hours are 10 - 96 / 36, 10 - 192 / 36 and
    # 4 - 16; their mean is 0; over the mean duration of 1 / 12 h they are the contributions.
    contributions = 12.0 * np.array([22 / 3, 14 / 3, -12.0])
    half = 1.959964 * contributions.std(ddof=1) / 3**0.5
    assert found["high"] - found["mean"] == pytest.approx(half, rel=1e-5)


def test_equal_tasks_have_an_interval_of_no_width() -> None:
    assert mean_of(tasks_of([10, 10], [100.0, 100.0]).throughput()) == {
        "mean": pytest.approx(360.0),
        "low": pytest.approx(360.0),
        "high": pytest.approx(360.0),
    }


def test_result_has_a_row_per_condition_and_paired_differences(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(people, "N_OBJECTS", 2)
    monkeypatch.setattr(people, "LIMIT_S", 40.0)
    reported = []
    result = evaluate(
        "sorting-cycle-time",
        pretrained.load(default_checkpoint("sorting-cycle-time")),
        episodes=2,
        seed=4,
        on_row=lambda *what: reported.append(what),
    )
    rows = {row["name"]: row for row in result["results"]}
    assert [done for done, _, _ in reported] == [1, 2, 3, 4, 5, 6]
    assert [row for _, _, row in reported] == result["results"]
    beside, alone = rows["planner"], rows["alone"]
    assert beside["parts_per_hour"]["mean"] < alone["parts_per_hour"]["mean"]
    assert alone["stopped"]["mean"] == alone["contacts_at_rest"]["mean"] == 0.0
    assert beside["stopped"]["mean"] > 0.0
    assert rows["planner-distance"]["stopped"]["mean"] > beside["stopped"]["mean"]
    difference = {pair["name"]: pair["parts_per_hour"]["mean"] for pair in result["paired"]}
    less = beside["parts_per_hour"]["mean"] - alone["parts_per_hour"]["mean"]
    assert difference["planner - alone"] == pytest.approx(less)


def test_planner_moves_straight_to_its_target_whatever_the_person_does() -> None:
    networks, cell, settings = parts_of(pretrained.load("pick"))
    bench = SortingBesidePeople(networks, cell, settings, 4, 3, STRAIGHT)
    bench._begin()
    rows = np.arange(4)
    acts = bench._steer(rows, nearest)
    away = bench.batch.state.q_goal - bench.batch.state.q
    shares = acts / np.abs(acts).max(axis=1, keepdims=True)
    wanted = away[:, :5] / np.abs(away[:, :5]).max(axis=1, keepdims=True)
    np.testing.assert_allclose(shares, wanted, atol=1e-5)
