"""Report on chapter 5 of the thesis: task and motion together."""

from app.policies.report.parts import (
    STANDING_STILL,
    Curve,
    Item,
    Measure,
    StoredValue,
    configured,
    trained,
)

BOTH = "Both (chapter 5)"
RECIPE = "pick-td3-thesis"
TRAINED = trained(RECIPE, "thesis-pick")
EVALUATED = " && ".join(
    f"python -m app evaluate pick-{kind} --checkpoint RUN/step-NUMBER.safetensors --json > "
    f"docs/results/thesis-pick-{kind}.json"
    for kind in ("single", "choice")
)


def at_both_limits(
    label: str, file: str, row: str, thesis: tuple[str, str, str]
) -> tuple[Measure, ...]:
    """Return success, collision and timeout of the recipe at 10 s and 20 s.

    Args:
        label: Start of the names of the lines.
        file: Result file without ``thesis-``, and that of Tandem's best policy.
        row: Name of the row.
        thesis: Numbers of the thesis.
    """
    best = "policy" if row == "policy" else "critic"
    return tuple(
        Measure(
            f"{label}, {limit:.0f} s: {end}",
            number,
            StoredValue(f"thesis-{file}", row if limit == 10 else f"{limit:.0f} s {row}", end),
            StoredValue(file, best, end) if limit == 10 else "",
        )
        for limit in (10, 20)
        for end, number in zip(("success", "collision", "timeout"), thesis, strict=True)
    )


BIAS = "task-maximisation-bias"


def of_both_choices(label: str, row: str, key: str, unit: str = "") -> tuple[Measure, ...]:
    """Return a number of trainings with uniform targets, the critic's, and the difference.

    Args:
        label: Start of the names of the lines.
        row: Name of the row behind that of the choice.
        key: Key in the row.
        unit: Unit of a quantity; empty for a rate.
    """
    return tuple(
        Measure(f"{label}: {name}", "", "", StoredValue(BIAS, f"{choice} {row}", key, unit))
        for name, choice in (
            ("uniform targets", "uniform"),
            ("targets chosen by the critic", "critic"),
            ("difference, paired", "critic - uniform"),
        )
    )


BOTH_ITEMS = (
    Item(
        chapter=BOTH,
        title="Task maximisation bias (5.2)",
        measures=(
            *of_both_choices("success, each target in turn", "all", "success"),
            *of_both_choices("least success of a target", "all", "least_success"),
            *of_both_choices("value at the start less return", "all", "error", "of reward"),
            *of_both_choices("its absolute value", "all", "error_abs", "of reward"),
            *of_both_choices(
                "success with the target that the critic chooses", "chosen", "success"
            ),
        ),
        agreement="agrees on the values: those of rarely chosen targets are underestimated. "
        "The success differs by less than three seeds can tell. The thesis prints no numbers "
        "([notebook](../notebook/pick.md#task-maximisation-bias)).",
        command="python -m tools.docs.task_maximisation FOLDER",
        images=(
            ("pick/task-maximisation-bias.png", "Success and error of the value per target"),
        ),
    ),
    Item(
        chapter=BOTH,
        title="Table 5.1: environment",
        measures=configured(
            RECIPE,
            ("success reward", "1", "reward.c_s"),
            ("collision cost", "1", "reward.c_c"),
            ("distance reward", "0.5", "reward.c_d"),
            ("angle reward", "0.5", "reward.c_th"),
            ("step cost", "0.02", "reward.c_step"),
            ("TCP speed cost", "1", "reward.c_v"),
        ),
        agreement="the preset is the table, with the signs that the text asks for.",
    ),
    Item(
        chapter=BOTH,
        title="Table 5.2: hyper-parameters",
        measures=configured(
            RECIPE,
            ("training steps", "4e6", "learning.total_steps"),
            ("training episode [s]", "20", "episode.time_limit_s"),
            ("discount", "0.99", "learning.gamma"),
            ("actor and critic learning rate", "1e-4", "learning.lr_start"),
            ("memory", "500,000", "learning.buffer_size"),
            ("batch size", "64", "learning.batch_size"),
            ("target update factor τ", "0.001", "learning.tau"),
            ("critic updates per update of the policy", "3", "learning.policy_delay"),
            ("parameter space noise σ", "0.5", "exploration.parameter_sigma"),
        ),
        agreement="the preset is the table; what the table leaves out is the default of the "
        "library of chapters 3 and 4 ([method](../method.md#35-learning)).",
    ),
    Item(
        chapter=BOTH,
        title="Figure 5.3: learning curve",
        measures=(
            *(
                Measure(f"{end}, last point", number, Curve("thesis-pick", RECIPE, end))
                for end, number in (
                    ("success", "75 % after 2e6 steps"),
                    ("collision", "25 %"),
                    ("timeout", "0 %"),
                )
            ),
            Measure(
                "reward, last point",
                "a figure",
                Curve("thesis-pick", RECIPE, "reward", "points"),
            ),
            Measure(
                "return of standing still in the same episodes",
                "",
                Curve("thesis-pick", RECIPE, STANDING_STILL),
            ),
        ),
        images=(("pick/curve-thesis.png", "Learning curve of the recipe of chapter 5"),),
        agreement="no, with one seed, stopped after 2.6 M of 4 M steps, 1.4 M of them without "
        "a change: every episode ends in a contact. With the printed coefficients that returns "
        "-1.4, and a straight motion to the target, which succeeds in 67 % of the same "
        "episodes, -1.2 ([notebook](../notebook/pick.md#the-recipe-of-the-thesis)).",
        command=TRAINED,
    ),
    Item(
        chapter=BOTH,
        title="One target, and choice of the target (5.3.4, 5.3.5)",
        measures=(
            *at_both_limits("one target", "pick-single", "policy", ("75 %", "25 %", "0 %")),
            *at_both_limits(
                "choice among 2 or 3 targets by the critic",
                "pick-choice",
                "critic-each-step",
                ("about 90 %", "", ""),
            ),
            Measure(
                "choice of the nearest target: success",
                "",
                StoredValue("thesis-pick-choice", "nearest", "success"),
                StoredValue("pick-choice", "nearest", "success"),
            ),
        ),
        agreement="the choice by the critic raises success in the thesis and here. Tandem's "
        "best policy must grasp and lift an object within 12 s; in the thesis and its recipe "
        "a target counts as reached within 0.1 m. The training of the recipe above learned "
        "contacts only, which leaves nothing to choose.",
        command=EVALUATED,
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
