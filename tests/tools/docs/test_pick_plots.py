"""The pictures of the case studies and of the calibration show what the results state."""

import numpy as np

from tools.docs.pick_plots import PICTURES, cases, reliability
from tools.docs.results import RESULTS, ROOT, read_result


def test_each_case_shows_the_values_of_both_goals_over_time() -> None:
    result = read_result(RESULTS / "pick-cases.json")
    for view, row in zip(cases(result).axes, result["results"], strict=True):
        curves = result["curves"][row["name"]]
        medians = {tuple(line.get_ydata()) for line in view.lines}
        assert medians == {tuple(np.array(one)[:, 1]) for one in curves["values"].values()}
        assert row["name"] in view.get_title()
        assert "(expected)" in str([text.get_text() for text in view.get_legend().get_texts()])


def test_the_reliability_diagram_shows_every_bin() -> None:
    result = read_result(RESULTS / "risk-calibration.json")
    views = reliability(result).axes
    assert len(views) >= len(result["results"])
    for view, row in zip(views, result["results"], strict=False):
        assert view.get_title() == row["name"]
        for line, outcome in zip(view.lines, ("success", "contact"), strict=False):
            bins = [(one["probability"], one["rate"]) for one in row[outcome]["bins"]]
            np.testing.assert_allclose(line.get_xydata(), 100.0 * np.array(bins))
            assert line.get_label() == outcome


def test_the_page_shows_the_pictures() -> None:
    page = (ROOT / "docs/results/pick.md").read_text("utf-8")
    for image in ("cases.png", "reliability.png"):
        assert (PICTURES / image).is_file()
        assert f"(../img/pick/{image})" in page
