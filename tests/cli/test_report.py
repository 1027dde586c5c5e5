"""The report that compares Tandem with the thesis."""

import json
import re
from pathlib import Path

import pytest

from app.__main__ import main
from app.cli.report import PAGE, RESULTS
from app.policies.report.numbers import curve_end, preset_value, setting, stored_value
from app.policies.report.page import TEXT, files_of, page

PRINTED = (
    "Table 3.1", "Figure 3.1", "Figure 3.2", "figure 3.3", "Figure 4.1", "Table 4.1",
    "Table 4.2", "Figure 4.4", "Figures 4.5, 4.6", "Table 4.3", "Figure 4.7", "Figure 4.9",
    "table 4.4", "Outlook (4.5)", "Table 5.1", "Table 5.2", "Figure 5.3", "Table 5.3",
    "figures 5.4 to 5.7",
)  # fmt: skip
"""Tables and figures of the results of the thesis."""
SECTIONS = TEXT.split("\n### ")[1:]


def test_the_page_of_the_site_is_the_one_that_stored_results_give():
    assert PAGE.read_text(encoding="utf-8") == page(RESULTS)[0]


def test_every_table_and_figure_is_there_in_the_order_of_the_thesis():
    text = page(RESULTS)[0]
    places = [text.index(one) for one in PRINTED]
    assert places == sorted(places)
    assert len(re.findall(r"^\*Agreement\*: .*\.$", text, re.MULTILINE)) == len(SECTIONS)


def test_images_exist():
    paths = re.findall(r"^!\[[^]]+\]\((.+)\)$", TEXT, re.MULTILINE)
    assert paths and all((PAGE.parent / path).exists() for path in paths)


def test_every_placeholder_has_a_known_form():
    assert not re.search(r"[{}]", page(RESULTS)[0])


def test_every_number_names_its_file_command_commit_and_machine():
    written = page(RESULTS)[0].split("\n### ")[1:]
    for section, text in zip(SECTIONS, written, strict=True):
        for file in files_of(section):
            if (RESULTS / f"{file}.json").exists():
                assert re.search(rf"`docs/results/{file}\.json`: `python -m .+commit `", text)


def test_without_results_everything_is_not_measured_and_commands_are_named(tmp_path: Path):
    text, missing = page(tmp_path)
    assert "%" not in "".join(re.findall(r"\| ([^|]*) \|\n", text))
    assert any(name.startswith("Table 5.3") for name in missing)
    assert "not measured: `python -m tools.docs.training_curves reach-ddpg-authors" in text


def test_the_command_writes_the_page_and_says_what_is_missing(tmp_path: Path, capsys):
    out = tmp_path / "sub" / "report.md"
    assert main(["report", "--quick", "--output", str(out), "--json"]) == 0
    assert out.read_text(encoding="utf-8") == PAGE.read_text(encoding="utf-8")
    assert json.loads(capsys.readouterr().out)["page"] == str(out)


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path, capsys):
    assert main(["report", "--quick", "--results", str(tmp_path / "none")]) == 2
    assert "must be a folder of result files" in capsys.readouterr().err


@pytest.mark.parametrize("content", ["", "{bad", "[]", "\udc80"])
def test_a_file_that_holds_no_result_is_named(tmp_path: Path, content: str, capsys):
    path = tmp_path / "pick-single.json"
    path.write_bytes(content.encode(errors="surrogateescape"))
    assert (
        main(["report", "--quick", "--results", str(tmp_path), "--output", str(tmp_path / "a")])
        == 2
    )
    said = capsys.readouterr().err
    assert f"results = '{path}' is not a result file" in said and "Traceback" not in said


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--quick", "--episodes", "5"], "--episodes = 5 must be left out with --quick"),
        (["--results", "{folder}"], "--results = '{folder}' needs --quick"),
    ],
)
def test_options_that_the_report_does_not_take_are_refused(
    options: list[str], said: str, tmp_path: Path, capsys
):
    words = [one.format(folder=tmp_path) for one in options]
    assert main(["report", *words, "--output", str(tmp_path / "a")]) == 2
    assert said.format(folder=tmp_path) in capsys.readouterr().err


def test_a_page_that_cannot_be_written_is_refused(tmp_path: Path, capsys):
    assert main(["report", "--quick", "--output", str(tmp_path)]) == 2
    assert f"--output = '{tmp_path}' cannot be written: Is a dir" in capsys.readouterr().err


def test_numbers_are_written_with_interval_deviation_or_unit():
    rate = {"mean": 0.5, "low": 0.25, "high": 0.75}
    found = {"results": [{"name": "a", "rate": rate, "time_s": {**rate, "sd": 0.1}, "ms": 2.0}]}
    assert stored_value(found, "a", "rate") == "50.00 % (25.00-75.00)"
    assert stored_value(found, "a", "time_s", "s") == "0.50 ± 0.10 s"
    assert stored_value(found, "a", "ms", "ms") == "2 ms"
    assert stored_value(found, "a", "rate", "1/h") == "0.50 (0.25 to 0.75) 1/h"
    parts = {"results": [{"name": "a", "n": {"mean": 12.0, "low": 9.04, "high": 15.0}}]}
    assert stored_value(parts, "a", "n", "1/h") == "12.0 (9.0 to 15.0) 1/h"
    pair = {"results": [], "paired": [{"name": "a - b", "rate": rate}]}
    assert stored_value(pair, "a - b", "rate") == "50.00 % (25.00-75.00)"
    assert stored_value(found, "b", "ms", "ms") is None
    gain = {"name": "a - b", "rate": {"mean": -0.02, "low": -0.15, "high": 0.11}}
    assert stored_value({"paired": [gain]}, "a - b", "rate") == "-2.00 % (-15.00 to 11.00)"
    ends = [{"step": 4_000_000, "success": share, "reward": -2.0} for share in (0.2, 0.4)]
    curves = [{"name": "p", "played": [one]} for one in ends]
    said = curve_end({"curves": curves}, "p", "success")
    assert said == "30.0 % after 4.00 M steps, 2 seeds"
    one = curve_end({"curves": curves[:1]}, "p", "reward", "points")
    assert one == "-2.00 after 4.00 M steps, 1 seed"

    def curve(*points):
        played = [{"step": n, "success": share, "reward": r} for n, share, r in points]
        return {"name": "p", "played": played}

    learns = curve((500_000, 0.1, -5.0), (4_000_000, 0.4, -2.0))
    frozen = curve((500_000, 0.0, -9.0), (1_000_000, 0.0, -9.0))
    said = curve_end({"curves": [learns, frozen]}, "p", "success")
    assert said == "20.0 % after 4.00 M steps, 2 seeds"
    stopped = curve((500_000, 0.0, -9.0), (1_000_000, 0.0, -9.5))
    said = curve_end({"curves": [learns, stopped]}, "p", "success")
    assert said == "5.0 % after 1.00 M steps, 2 seeds"
    still = {"curves": [{"name": "p", "played": [], "standing_still": -3.0}]}
    assert curve_end(still, "p", "standing_still") == "-3.00"
    assert curve_end(still, "p", "success") is None
    assert curve_end({"curves": curves}, "q", "success") is None
    assert preset_value("reach-ddpg-thesis", "learning.lr_start", "10") == "0.001"
    assert preset_value("reach-ddpg-thesis", "action.meaning") == "speed"
    assert setting("reach-ddpg-thesis", "control_rate") == "50"
    assert setting("reach-ddpg-thesis", "v_min") == "0.3"
    assert setting("pick-td3-thesis", "success_tilt") == "0.2"
