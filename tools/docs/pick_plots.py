"""Draw the case studies and the calibration of the pick policy.

    python -m tools.docs.pick_plots

Reads ``docs/results/pick-cases.json`` and ``risk-calibration.json``; writes
``docs/img/pick/cases.png``, like figures 5.4 to 5.7 of the thesis, and ``reliability.png``.
"""

import numpy as np
from matplotlib.figure import Figure

from app.sim.pick.cases import find_case
from tools.arguments import parser_of
from tools.docs.results import IMAGES, RESULTS, Json, read_result
from tools.docs.world.plots import BLUE, GREEN, GREY, ORANGE, RED, panels, save

PICTURES = IMAGES / "pick"


def cases(result: Json) -> Figure:
    """Draw the critic's value of each goal over time, median and quartiles of all starts."""
    figure, axes = panels(2, 2, 5.6, sharex=True, sharey=True)
    for view, row in zip(axes.flat, result["results"], strict=True):
        case, curves = find_case(row["name"]), result["curves"][row["name"]]
        for goal, colour in zip(case.goals, (ORANGE, BLUE), strict=True):
            low, middle, high = np.array(curves["values"][goal]).T
            name = f"{goal} (expected)" if goal == case.expected else goal
            view.plot(curves["t_s"], middle, color=colour, label=name)
            view.fill_between(curves["t_s"], low, high, color=colour, alpha=0.2, lw=0)
        share = 100.0 * row["as_expected"]["mean"]
        view.set_title(f"{row['name']}: {case.title} ({share:.0f} %)")
        view.legend(loc="lower right")
    for view in axes[-1]:
        view.set_xlabel("time [s]")
    for view in axes[:, 0]:
        view.set_ylabel("value Q of the critic")
    return figure


def reliability(result: Json) -> Figure:
    """Draw observed rates and intervals over predicted probabilities, by kind of people."""
    rows = result["results"]
    figure, axes = panels(2, -(-len(rows) // 2), 5.6, sharex=True, sharey=True)
    for view, row in zip(axes.flat, rows, strict=False):
        for outcome, colour in (("success", GREEN), ("contact", RED)):
            bins = row[outcome]["bins"]
            keys = ("probability", "rate", "low", "high")
            mean, rate, low, high = 100.0 * np.array([[one[k] for k in keys] for one in bins]).T
            view.plot(mean, rate, "o-", ms=3, color=colour, label=outcome)
            view.fill_between(mean, low, high, color=colour, alpha=0.12, lw=0)
        view.plot([0, 100], [0, 100], color=GREY, lw=0.9)
        view.set_title(row["name"])
    axes[0, 0].legend(loc="upper left")
    for view in axes.flat[len(rows) :]:
        view.set_axis_off()
    for view in axes.flat[len(rows) - axes.shape[1] : len(rows)]:
        view.tick_params(labelbottom=True)
        view.set_xlabel("predicted probability [%]")
    for view in axes[:, 0]:
        view.set_ylabel("observed rate [%]")
    return figure


def main() -> None:
    """Draw all pictures."""
    for name, draw, image in (
        ("pick-cases", cases, "cases.png"),
        ("risk-calibration", reliability, "reliability.png"),
    ):
        save(draw, PICTURES / image, read_result(RESULTS / f"{name}.json"))


if __name__ == "__main__":
    parser_of(__doc__).parse_args()
    main()
