"""The table of headline results in the README: eight results with their baselines.

Numbers come from ``docs/results/*.json``; baselines of the thesis are constants of this module.
"""

from pathlib import Path

from app.policies.evaluation.reach.ssm import DIRECTED
from tools.docs.results import Json, read_if_measured

FILES = (
    "pick-single",
    "pick-choice",
    "pick-choice-hard",
    "reach-targets",
    "reach-ssm",
    "sorting-grid-e1",
    "safety-ssm",
)
THESIS = {
    "pick-single": "75 % (arrival)",
    "pick-choice": "about 90 % (arrival)",
    "reach-targets": "91.76 %",
}
"""Success rates that the thesis reports."""
MANY = "two-people-4-to-6-targets-20-s"
"""First word of the rows beside two people with more targets and the thesis' time limit."""


def percent(rate: Json, digits: int = 1) -> str:
    """Return a rate with its interval in percent."""
    mean, low, high = (f"{100.0 * rate[key]:.{digits}f}" for key in ("mean", "low", "high"))
    return f"{mean} % ({low}-{high})"


def share(rate: Json) -> str:
    """Return a rate in percent without its interval."""
    return f"{100.0 * rate['mean']:.1f} %"


def lines(results: Path) -> list[list[str]] | None:
    """Return the table as lines of cells, the header first; None where a result is missing.

    Args:
        results: Folder of the JSON files.
    """
    found: dict[str, dict[str, Json]] = {}
    for name in FILES:
        if (result := read_if_measured(results / f"{name}.json")) is None:
            return None
        found[name] = {row["name"]: row for row in result["results"]}
    pick, choice, hard, reach, ssm, sorting, safety = (found[name] for name in FILES)
    rollout, planner = ssm[f"policy-rollout{DIRECTED}"], ssm[f"rrtstar-once{DIRECTED}"]
    return [
        ["task", "measure", "n", "Tandem", "baseline"],
        [
            "[pick](docs/results/pick.md), one target",
            "object lifted",
            f"{pick['policy']['n']:,}",
            percent(pick["policy"]["success"]),
            f"thesis: {THESIS['pick-single']}",
        ],
        [
            "pick, selection among 2 or 3 targets",
            "object lifted",
            f"{choice['critic']['n']:,}",
            percent(choice["critic"]["success"]),
            f"nearest: {share(choice['nearest']['success'])}, "
            f"oracle: {share(choice['oracle']['success'])}, thesis: {THESIS['pick-choice']}",
        ],
        [
            "the same beside two people",
            "object lifted",
            f"{hard['two-people critic']['n']:,}",
            percent(hard["two-people critic"]["success"]),
            f"nearest: {share(hard['two-people nearest']['success'])}, "
            f"oracle: {share(hard['two-people oracle']['success'])}",
        ],
        [
            "beside two people among 4 to 6 targets, within 20 s",
            "object lifted",
            f"{hard[f'{MANY} critic']['n']:,}",
            percent(hard[f"{MANY} critic"]["success"]),
            f"nearest: {share(hard[f'{MANY} nearest']['success'])}, "
            f"oracle: {share(hard[f'{MANY} oracle']['success'])}",
        ],
        [
            "[reach](docs/results/reach.md), 54 targets",
            "success under the rules of the authors' code",
            f"{reach['authors']['n']:,}",
            percent(reach["authors"]["success"]),
            f"thesis: {THESIS['reach-targets']}",
        ],
        [
            "reach under SSM, crossing people, velocity known exactly",
            "robot brought to standstill; time to goal",
            f"{rollout['n']:,}",
            f"{percent(_opposite(rollout['never_at_standstill']))}; "
            f"{rollout['time_s']['mean']:.2f} s",
            f"RRT*: {share(_opposite(planner['never_at_standstill']))}; "
            f"{planner['time_s']['mean']:.2f} s",
        ],
        [
            "[sorting](docs/results/sorting.md), 20 objects, disturbed starts",
            "success; moves / minimum",
            f"{sorting['disturbed']['n']:,}",
            f"{percent(sorting['disturbed']['success'], 2)}; "
            f"{sorting['disturbed']['moves_over_minimum']['mean']:.4f}",
            f"exact planner: {sorting['disturbed-planner']['moves_over_minimum']['mean']:.4f}",
        ],
        [
            "[SSM](docs/results/safety.md), adversarial people",
            "contact with a moving link",
            f"{safety['inside']['n']:,}",
            percent(safety["inside"]["moving_rate"], 3),
            f"without SSM: {share(safety['no-ssm']['moving_rate'])} "
            f"(n {safety['no-ssm']['n']:,})",
        ],
    ]


def _opposite(rate: Json) -> Json:
    return {
        "mean": 1.0 - rate["mean"],
        "low": 1.0 - rate["high"],
        "high": 1.0 - rate["low"],
    }
