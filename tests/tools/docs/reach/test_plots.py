"""Tables and pictures of the reach results, on results made for the test."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from tests.support import reach_results as made
from tools.docs.learning_curves import merged
from tools.docs.reach import curves as reach_curves
from tools.docs.reach import plots as reach_plots
from tools.docs.reach.other_plots import colour_of
from tools.docs.reach.tables import COLUMNS, is_reach, lines_of, siblings
from tools.docs.tables import BLOCK, render, table
from tools.docs.world.plots import BLUE, ORANGE

DOCS = Path(__file__).resolve().parents[4] / "docs"
PAGE = (DOCS / "results/reach.md").read_text(encoding="utf-8")
REPORT = (DOCS / "report/index.md").read_text(encoding="utf-8")


@pytest.fixture
def results(tmp_path: Path) -> Path:
    found = {
        "reach-targets": made.targets(),
        "reach-random": made.random_goals(),
        "reach-random.grid": made.random_goals(0.004, ("direct", "interpolated")),
        "reach-constant": made.result("reach-constant", [made.row("constant", 5400, 0.02)]),
        "reach-people": made.people(),
        "reach-people.set": made.people(),
        "reach-speeds": made.speeds(),
        "reach-tracker": made.tracker(),
        "reach-oracle": made.ceiling(),
        "reach-ssm": made.ssm(),
        "reach-smoothness": made.smoothness(),
        "reach-smoothness.jerk": made.smoothness(3),
        "reach-curves": made.curves(),
    }
    for name, one in found.items():
        (tmp_path / f"{name}.json").write_text(json.dumps(one), encoding="utf-8")
    return tmp_path


def test_every_protocol_has_its_place_on_the_page() -> None:
    assert {match[2] for match in BLOCK.finditer(PAGE)} >= set(COLUMNS)


def test_the_page_is_filled_from_its_results(results: Path) -> None:
    page = render(PAGE, results)
    for name in COLUMNS:
        block = next(match[0] for match in BLOCK.finditer(page) if match[2] == name)
        assert "| --- |" in block and "<sub>`python " in block
    assert render(page, results) == page


def test_a_target_is_named_by_its_height_above_the_floor() -> None:
    lines = lines_of([made.targets()])
    worst = lines[1][lines[0].index("worst target (x, y, height [m])")]
    assert re.fullmatch(r"\d+ % at \(-?0\.\d, (0\.[68]|1\.0), (0\.8|1\.0|1\.2)\)", worst)


def test_rows_of_several_checkpoints_say_whose_they_are(results: Path) -> None:
    path = results / "reach-random.json"
    first = json.loads(path.read_text(encoding="utf-8"))
    others = siblings(path)
    assert [one["label"] for one in others] == ["grid"]
    lines = lines_of([first, *others])
    assert lines[0][:2] == ["", "policy"]
    assert [line[1] for line in lines[1:]] == ["reach-td3"] * 3 + ["grid"] * 5
    assert table(first, others).count("`interpolated`") == 1
    assert "policy" not in lines_of([first])[0]


def test_a_difference_is_shown_in_points_with_its_sign() -> None:
    head, _, direct, _ = lines_of([made.random_goals()])
    assert direct[head.index("difference to targets [points]")] == "-0.30 (-0.70 to +0.10)"


def test_smoothness_is_a_line_per_measure(results: Path) -> None:
    lines = lines_of([made.smoothness(), *siblings(results / "reach-smoothness.json")])
    assert lines[0] == ["", "`degree-2`", "`degree-3`"]
    found = {line[0]: line[1:] for line in lines}
    assert found["maximum jerk [rad/s³]"] == ["", "50"]
    assert found["maximum speed step [rad/s]"] == ["4.4e-14", "4.4e-14"]


def test_times_under_the_safety_layer_have_their_spread_and_no_row_is_empty() -> None:
    head, policy, random = lines_of([made.ssm()])
    assert policy[head.index("time to goal [s]")] == "4.10 ± 0.90"
    assert random[head.index("success")].startswith("96.00 %")
    assert random[head.index("time to goal [s]")] == ""
    assert "FILE ..." not in table(made.ssm())


def test_rows_of_measured_velocities_have_a_table_of_their_own(results: Path) -> None:
    result = made.ssm()
    result["results"].append({**result["results"][0], "name": "policy-directed"})
    (results / "reach-ssm.json").write_text(json.dumps(result))
    blocks = "".join(
        f"<!-- begin {name} -->\n<!-- end {name} -->\n"
        for name in ("reach-ssm", "reach-ssm-directed")
    )
    lines = render(blocks, results).splitlines()
    found = [line.split("|")[1].strip() for line in lines if line.startswith("| `")]
    assert found == ["`policy`", "`random`", "`policy`"]


def test_results_of_other_tasks_are_left_to_others() -> None:
    assert not is_reach({"protocol": "pick-single"})
    assert is_reach({"protocol": "reach-targets"})


def test_every_picture_of_page_and_report_is_drawn(
    results: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    images = results / "img"
    monkeypatch.setattr(reach_plots, "RESULTS", results)
    monkeypatch.setattr(reach_plots, "PICTURES", images)
    reach_plots.main()
    shown = set(re.findall(r"\]\(\.\./img/reach/([a-z-]+\.png)\)", PAGE + REPORT))
    others = {"override.png", "arrivals.png"}  # of ssm_plots.py
    others |= {"curves-thesis.png", "ablation.png"}  # of recipe_plots.py
    assert {path.name for path in images.glob("*.png")} == shown - others
    assert all(path.stat().st_size > 10_000 for path in images.glob("*.png"))


def test_without_results_only_walks_are_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reach_plots, "RESULTS", tmp_path)
    monkeypatch.setattr(reach_plots, "PICTURES", tmp_path / "img")
    reach_plots.main()
    assert [path.name for path in tmp_path.rglob("*.png")] == ["walks.png"]


def test_each_square_of_the_heat_maps_is_its_target() -> None:
    result = made.targets()
    figure = reach_plots.heat_maps(result)
    cells = [cell for cell in result["results"][0]["targets"] if cell["height_m"] == 1.0]
    mesh = figure.axes[1].collections[0].get_array()
    expected = [
        [
            next(c for c in cells if c["goal"][:2] == [x, y])["success"]["mean"]
            for x in (-0.5, -0.3, -0.1, 0.1, 0.3, 0.5)
        ]
        for y in (0.6, 0.8, 1.0)
    ]
    np.testing.assert_allclose(mesh, expected)
    assert figure.axes[1].get_title().startswith("z = 1.0 m")


def test_presets_have_colours_of_their_own() -> None:
    assert colour_of("reach-td3") == BLUE
    assert colour_of("reach-ddpg-thesis") == ORANGE


def test_a_run_replaces_the_curve_of_its_preset_and_seed() -> None:
    old = made.curves()["curves"]
    again = {**old[1], "played": []}
    found = merged(old, [again])
    assert len(found) == len(old)
    assert sum(not one["played"] for one in found) == 1


def test_points_before_the_first_collision_count_are_left_out(tmp_path: Path) -> None:
    points = [
        {
            "preset": "reach-td3",
            "seed": 2,
            "step": step,
            "cpu_s": 0.1 * step,
            "success": success,
            "collision": collision,
            "timeout": 0.1,
        }
        for step, success, collision in ((10, None, None), (20, 0.5, 0.4))
    ]
    text = "".join(json.dumps(one) + "\n" for one in points)
    (tmp_path / "curve.jsonl").write_text(text, encoding="utf-8")
    curve = reach_curves.curve_of_run(tmp_path, 1)
    assert (curve["name"], curve["seed"]) == ("reach-td3", 2)
    assert [point["step"] for point in curve["played"]] == [20]
