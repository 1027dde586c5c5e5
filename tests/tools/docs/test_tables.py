from pathlib import Path

import pytest

from app.policies.evaluation.reach.ssm import DIRECTED
from tools.docs.pick_tables import p_value
from tools.docs.results import ROOT
from tools.docs.tables import (
    BLOCK,
    MULTI_RESULT_TABLES,
    conditions,
    header,
    pages,
    render,
    table,
)

RATE = {"mean": 0.9712, "low": 0.959, "high": 0.98}
MACHINE = {"cpu": "Some CPU", "cores": 2, "commit": "0123456789ab"}
EVALUATION = {
    "protocol": "pick-single",
    "checkpoint": "f" * 64,
    "seed": 11,
    "episodes": 1000,
    "results": [{"name": "policy", "n": 1000, "success": RATE, "time_s": 3.2512}],
    "machine": MACHINE,
}
BENCH = {
    "bench": "sim-steps",
    "results": [
        {"name": "pick/numba", "threads": 1, "value": 312345.6, "unit": "env-steps/cpu-s"},
        {"name": "fcl/pick", "threads": 1, "value": 12.5, "unit": "env-steps/cpu-s"},
    ],
    "machine": MACHINE,
}


def test_rates_are_shown_in_percent_with_their_interval() -> None:
    lines = table(EVALUATION).splitlines()
    assert lines[0] == "|  | n | success | time [s] |"
    assert lines[2] == "| `policy` | 1000 | 97.1 % (95.9-98.0) | 3.25 |"


@pytest.mark.parametrize(
    ("p", "text"), [(1.0, "1"), (0.0312, "0.03"), (3e-9, "3e-09"), (0.0, "below 1e-300")]
)
def test_p_values_that_no_number_can_hold_are_bounded(p: float, text: str) -> None:
    assert p_value(p) == text


def test_headers_carry_the_unit_of_their_key() -> None:
    keys = ("time_s", "joint_speed_rad_s", "center_p95_mm", "points_inside_percent", "success")
    shown = [
        "time [s]",
        "joint speed [rad/s]",
        "center p95 [mm]",
        "points inside [%]",
        "success",
    ]
    assert [header(key) for key in keys] == shown


def test_headline_has_eight_results_and_stays_without_them(tmp_path: Path) -> None:
    text = "<!-- begin headline -->\nold\n<!-- end headline -->\n"
    assert render(text, tmp_path) == text
    lines = render(text, ROOT / "docs/results").splitlines()
    assert sum(line.startswith("| ") for line in lines) == 2 + 8


def test_training_seeds_are_columns_and_the_table_stays_without_them(tmp_path: Path) -> None:
    text = "<!-- begin pick-seeds -->\nold\n<!-- end pick-seeds -->\n"
    assert render(text, tmp_path) == text
    head, _, *lines = render(text, ROOT / "docs/results").splitlines()[1:-1]
    assert head == "| training seed | 1, shipped | 2 | 3 | mean |"
    (rates,) = (line for line in lines if line.startswith("| one target: success"))
    *seeds, mean = (float(cell.split("%")[0]) for cell in rates.split("|")[2:-1])
    assert rates.count(" % (") == len(seeds) == 3
    assert mean == pytest.approx(sum(seeds) / 3, abs=0.1)


def test_line_below_a_table_says_how_it_was_measured() -> None:
    line = table(EVALUATION).splitlines()[-1]
    for part in ("evaluate pick-single", "seed 11", "`ffffffffffff`", "2 cores of Some CPU"):
        assert part in line


def test_bench_values_are_compact_numbers() -> None:
    lines = table(BENCH).splitlines()
    assert lines[2] == "| `pick/numba` | 1 | 312,346 | env-steps/cpu-s |"
    assert lines[3] == "| `fcl/pick` | 1 | 12.5 | env-steps/cpu-s |"


def test_text_outside_the_markers_stays_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "x.json").write_text(
        '{"bench": "x", "results": [], "machine": {"cpu": "c", "cores": 1, "commit": null}}'
    )
    text = render("before\n<!-- begin x -->\nold\n<!-- end x -->\nafter\n", tmp_path)
    assert text.startswith("before\n<!-- begin x -->\n|")
    assert text.endswith("<!-- end x -->\nafter\n")
    assert "old" not in text


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.name)
def test_tables_equal_what_the_results_give(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert render(text, ROOT / "docs" / "results") == text


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.name)
def test_every_table_has_its_result(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    names = {match[2].removesuffix(DIRECTED) for match in BLOCK.finditer(text)}
    assert {
        name
        for name in names - MULTI_RESULT_TABLES.keys()
        if not (ROOT / f"docs/results/{name}.json").exists()
    } == set()


def test_conditions_name_the_people_and_the_second_look() -> None:
    shown = conditions(
        {
            "settings": {"hand_speed_median_m_s": 0.41, "hand_speed_p99_m_s": 1.68},
            "fcl_recheck": {"missed_contacts": 0, "poses": 52830, "episodes": 200},
        }
    )
    assert shown == [
        "hands 0.41 m/s (median), 1.68 m/s (p99)",
        "FCL found 0 missed contacts in 52,830 poses",
    ]


def test_result_without_rows_leaves_its_section_to_its_own_script(tmp_path: Path) -> None:
    (tmp_path / "x.json").write_text('{"page": "people"}')
    text = "<!-- begin x -->\nwritten elsewhere\n<!-- end x -->\n"
    assert render(text, tmp_path) == text


def test_rates_of_seeds_and_a_difference_below_zero_are_shown() -> None:
    rows = [
        {"name": "a", "by": [0.981, 1.0], "more": {"mean": 0.01, "low": -0.02, "high": 0.04}}
    ]
    lines = table({"command": "python x.py", "results": rows, "machine": MACHINE}).splitlines()
    assert lines[2] == "| `a` | 98.1, 100.0 | 1.0 % (-2.0 to 4.0) |"
    assert lines[-1].startswith("<sub>`python x.py`, 2 cores")


def test_recorded_people_are_counted_below_the_table() -> None:
    motions = [{"source": "a", "seconds": 12.0}, {"source": "b", "seconds": 8.4}]
    assert conditions({"settings": {"motions": motions}}) == [
        "2 recorded runs of 20 s together"
    ]
