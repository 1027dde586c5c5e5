"""Report on chapter 5 of the thesis: task and motion together."""

from app.cli.report.parts import Config, Curve, Item, Measure, StoredValue, rates, trained

BOTH = "Both (chapter 5)"
PICK = trained("pick-td3", "pick-curves")
NO_PRESET = "no preset"
"""In place of a recipe that Tandem does not have."""

BOTH_ITEMS = (
    Item(
        chapter=BOTH,
        title="Tables 5.1, 5.2, figure 5.3: training",
        measures=(
            Measure(
                "training steps", "4e6", NO_PRESET, Config("pick-td3", "learning.total_steps")
            ),
            Measure("discount", "0.99", NO_PRESET, Config("pick-td3", "learning.gamma")),
            Measure("memory", "500,000", NO_PRESET, Config("pick-td3", "learning.buffer_size")),
            Measure("batch size", "64", NO_PRESET, Config("pick-td3", "learning.batch_size")),
            Measure(
                "policy delay", "3", NO_PRESET, Config("pick-td3", "learning.policy_delay")
            ),
            Measure(
                "reward at the end",
                "a figure",
                NO_PRESET,
                Curve("pick-curves", "pick-td3", "reward", "points"),
            ),
        ),
        agreement="open: no preset repeats table 5.2; parameter-space noise and the curriculum"
        " of starts are not built. `pick-td3` is Tandem's own.",
        command=PICK,
    ),
    Item(
        chapter=BOTH,
        title="One target, and choice of the target (5.3.4, 5.3.5)",
        measures=(
            *rates("pick-single", "policy", "one target", ("75 %", "25 %", "0 %"), NO_PRESET),
            Measure(
                "choice among 2 or 3 targets by the critic: success",
                "about 90 %",
                NO_PRESET,
                StoredValue("pick-choice", "critic", "success"),
            ),
            Measure(
                "choice of the nearest target: success",
                "",
                "",
                StoredValue("pick-choice", "nearest", "success"),
            ),
        ),
        agreement="the choice by the critic raises success in both. Here an object must be "
        "grasped and lifted within 12 s; in the thesis it counts as reached within "
        "0.1 m, with a limit printed as 10 s and as 20 s.",
    ),
    Item(
        chapter=BOTH,
        title="Table 5.3, figures 5.4 to 5.7: case studies",
        measures=tuple(
            Measure(
                f"case {number}: as expected",
                "one run, yes",
                "",
                StoredValue("pick-cases", f"case-{number}", "as_expected"),
            )
            for number in range(1, 5)
        ),
        images=(("pick/cases.png", "Value of each goal over time in the four case studies"),),
        agreement="both choose as expected; cases 2 to 4 have other stations here, because "
        "those of the thesis are too close to the arm for a grasp "
        "([method](../method.md#36-evaluation)).",
    ),
)
