"""Report on the trainings of all recipes beside ours."""

from app.policies.report.parts import Curve, Item, Measure, trained

CURVES = (
    ("sorting, e0", "thesis-sorting", "sorting-e0-thesis", "sorting-curves", "sorting-e0-dqn"),
    ("sorting, e1", "thesis-sorting", "sorting-e1-thesis", "sorting-curves", "sorting-e1-dqn"),
    ("reach", "thesis-reach", "reach-ddpg-authors", "reach-curves", "reach-td3"),
    ("pick", "thesis-pick", "pick-td3-thesis", "pick-curves", "pick-td3"),
)
"""Scenario; file and name of the curves of its recipe, and of ours."""
PRINTED = {"reach success": "91.76 %", "pick success": "75 %", "pick collision": "25 %"}
"""Rates that the thesis prints."""


def _lines() -> tuple[Measure, ...]:
    return tuple(
        Measure(
            f"{scenario}: {text}",
            PRINTED.get(f"{scenario} {key}", ""),
            Curve(file, recipe, key, unit),
            Curve(own_file, own, key, unit, own.removesuffix("-dqn") if sorts else ""),
        )
        for scenario, file, recipe, own_file, own in CURVES
        for sorts in (scenario.startswith("sorting"),)
        for text, key, unit in (
            ("success, last point", "success", ""),
            ("collision, last point", "collision", ""),
            ("processor time [s]", "cpu_s", "s"),
        )
        if not (sorts and key == "collision")
    )


RECIPE_ITEMS = (
    Item(
        chapter="All chapters",
        title="Trainings of the recipes beside ours",
        measures=_lines(),
        images=(
            (
                "recipes.png",
                "Success (solid) and collisions (dashed) of all trainings over environment"
                " steps, updates and processor time, a line per seed; grey: the thesis",
            ),
        ),
        agreement="open: no recipe was trained to its end yet. Ours exceed the success that"
        " the thesis prints for reaching and picking within minutes of processor time; picking"
        " here includes the grasp and the lift. The thesis prints no rate for sorting.",
        command=" ; ".join(
            (
                *(trained(f"sorting-{task}-thesis", "thesis-sorting") for task in ("e0", "e1")),
                trained("pick-td3", "pick-curves"),
                "python -m tools.docs.recipe_plots",
            )
        ),
    ),
)
