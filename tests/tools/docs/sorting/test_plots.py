"""Tables and pictures of the sorting results, on results made for the test."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.policies.evaluation.sorting_players import untrained
from tools.docs.learning_curves import merged
from tools.docs.sorting import curves as sorting_curves
from tools.docs.sorting import plots as sorting_plots
from tools.docs.sorting.curves import curve_of_run, curve_of_stock
from tools.docs.sorting.plots import TASKS, colour_of, grids, recipes
from tools.docs.tables import table
from tools.docs.world.plots import BLUE, GREEN, GREY, ORANGE

MACHINE = {"cpu": "Some CPU", "cores": 2, "commit": "0123456789ab"}


def rate(mean: float) -> dict[str, float]:
    return {"mean": mean, "low": mean - 0.001, "high": mean}


def grid_row(name: str, size: int = 3) -> dict[str, object]:
    pairs = [
        {
            "n_objects": n,
            "n_goal": g,
            "success": rate(1.0 - 0.01 * g * (n == size)),
            "return": 0.1 * n - 0.2 * g,
            "below": False,
        }
        for n in range(1, size + 1)
        for g in range(1, n + 1)
    ]
    return {
        "name": name,
        "n": 6000,
        "success": rate(0.99876),
        "worst_pair": {**rate(0.97), "n_objects": size, "n_goal": size},
        "pairs_below": 0,
        "moves_over_minimum": {"mean": 1.00123, "low": 1.001, "high": 1.00146},
        "riskier_pick": None,
        "mean_return": 0.45678,
        "pairs": pairs,
    }


def result(**more: object) -> dict[str, object]:
    return {
        "protocol": "sorting-grid",
        "checkpoint": "f" * 64,
        "seed": 11,
        "episodes": 1000,
        "settings": {"cell": "sorting-e1", "least_success": 0.98},
        "results": [grid_row("clean"), grid_row("disturbed")],
        "machine": MACHINE,
        **more,
    }


def test_the_table_of_the_grid_has_a_line_per_measure() -> None:
    lines = table(result()).splitlines()
    assert lines[0] == "|  | `clean` | `disturbed` |"
    both = {line.split(" | ")[0][2:]: line.split(" | ")[1] for line in lines[2:14]}
    assert both["success"] == "99.88 % (99.78-99.88)"
    assert both["worst pair"] == "97.00 % (96.90-97.00) at 3, 3"
    assert both["pairs below 98 %"] == "0"
    assert both["moves / minimum"] == "1.0012 (1.0010-1.0015)"
    assert (both["riskier picks"], both["return"], both["n"]) == ("", "0.457", "6,000")
    assert "evaluate sorting-grid --checkpoint FILE`, episodes 1000" in lines[-1]


def test_the_table_of_the_six_tests_has_a_line_per_row() -> None:
    row = {"name": "test-1", "n": 1000, "success": rate(0.997), "fewest": rate(0.99)}
    settings = {"cell": "sorting-e0"}
    shown = table(result(protocol="sorting-tests", results=[row], settings=settings))
    lines = shown.splitlines()
    assert lines[2].startswith("| `test-1` | 1,000 | 99.70 % (99.60-99.70) | 99.00 %")
    assert "evaluate sorting-tests --checkpoint FILE`" in lines[-1]


def test_the_table_of_full_tasks_has_a_column_per_rule_and_per_difference() -> None:
    cycle = {"mean": 101.4, "low": 99.9, "high": 102.9}
    less = {"mean": -3.5, "low": -5.6, "high": -1.4}
    row = {"name": "critic", "n": 300, "finished": rate(1.0), "cycle_time_s": cycle}
    row["parts_per_hour"] = {"mean": 219.6}
    pair = {"name": "critic - planner", "n": 300, "cycle_time_s": less}
    settings = {"cell": "sorting-e0"}
    shown = table(
        result(protocol="sorting-people", results=[row], paired=[pair], settings=settings)
    ).splitlines()
    assert shown[0] == "|  | `critic` | `critic - planner` |"
    assert shown[3] == "| finished | 100.00 % (99.90-100.00) |  |"
    assert "| parts per hour | 219.60 |  |" in shown
    assert "| cycle time [s] | 101.40 (99.90-102.90) | -3.50 (-5.60 to -1.40) |" in shown


def test_grids_hold_every_pair_and_nothing_else() -> None:
    success, returns = grids(grid_row("clean"))
    assert np.isfinite(success).sum() == np.isfinite(returns).sum() == 6
    assert np.isnan(success[2, 1])
    assert success[1, 2] == pytest.approx(0.98)
    assert returns[0, 2] == pytest.approx(0.1)


def test_curves_have_the_colours_of_who_learned() -> None:
    names = ("sorting-e0-dqn", "sorting-e1-dqn-pure", "sorting-e1-thesis", sorting_curves.STOCK)
    assert [colour_of(name) for name in names] == [BLUE, GREEN, ORANGE, GREY]


def test_curves_of_the_recipe_are_those_with_four_attempts_per_update() -> None:
    point = {"step": 50_000, "cpu_s": 61.0, "success": 0.1, "reward": -4.5}
    name = "sorting-e1-thesis, four attempts per update"
    curve = {"name": name, "seed": 1, "played": [point]}
    others = [{**curve, "name": f"{name}, until flat"}, {**curve, "name": "sorting-e1-thesis"}]
    (shown,) = recipes({"curves": [*others, curve]}, "e1")
    assert (shown["name"], shown["seed"], shown["pairs"]) == (name, 1, [])
    assert shown["played"] == [{**point, "mean_return": -4.5}]
    assert recipes({"curves": [curve]}, "e0") == []


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A training's folder with two points and one policy."""
    folder = tmp_path / "run"
    folder.mkdir()
    policy = untrained()
    (folder / "step-000000000.json").write_text(json.dumps(policy.manifest))
    (folder / "step-000000000.safetensors").write_bytes(policy.tensors)
    common = {"preset": "sorting-e0-dqn", "seed": 1, "success": 0.1, "reward": -1.0}
    points = [{**common, "step": k, "cpu_s": 2.0 + k} for k in (0, 5)]
    (folder / "curve.jsonl").write_text("".join(f"{json.dumps(one)}\n" for one in points))
    return folder


def test_a_run_is_a_curve_of_its_points_and_of_its_policies_on_every_pair(run: Path) -> None:
    curve = curve_of_run(run, 1)
    assert (curve["task"], curve["name"], curve["seed"]) == ("sorting-e0", "sorting-e0-dqn", 1)
    assert [one["step"] for one in curve["played"]] == [0, 5]
    (point,) = curve["pairs"]
    assert (point["step"], point["cpu_s"]) == (0, 2.0)
    assert 0.0 <= point["success"] < 0.9 and point["return_sd"] > 0.0


def test_curves_of_the_same_run_are_replaced_and_others_stay(tmp_path: Path) -> None:
    file = tmp_path / "stock.jsonl"
    file.write_text('{"env_steps": 20000, "cpu_s": 31.5, "success": 0.1, "return": -3.0}\n')
    stock = curve_of_stock("sorting-e0", file)
    assert stock["played"] == [
        {"step": 20000, "cpu_s": 31.5, "success": 0.1, "mean_return": -3.0}
    ]
    old = [{**stock, "name": "a", "seed": 1}, {**stock, "name": "a", "seed": 2}]
    new = {**stock, "name": "a", "seed": 2, "played": []}
    assert merged(old, [new, stock]) == [old[0], new, stock]


def test_pictures_are_drawn_of_what_has_a_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sorting_plots, "RESULTS", tmp_path)
    monkeypatch.setattr(sorting_plots, "PICTURES", tmp_path / "img")
    sorting_plots.main()
    assert not (tmp_path / "img").exists()
    (tmp_path / "sorting-grid-e1.json").write_text(json.dumps(result()))
    point = {"step": 1000, "cpu_s": 3.0, "success": 0.5, "mean_return": 0.1, "return_sd": 0.2}
    curve = {"task": "sorting-e0", "name": "sorting-e0-dqn", "seed": 1, "played": [point]}
    curves = {"curves": [{**curve, "pairs": [point]}]}
    (tmp_path / "sorting-curves.json").write_text(json.dumps(curves))
    sorting_plots.main()
    assert {one.name for one in (tmp_path / "img").iterdir()} == {
        f"grid-{TASKS[1]}.png",
        f"curves-{TASKS[0]}.png",
    }
