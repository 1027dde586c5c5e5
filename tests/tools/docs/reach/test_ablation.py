"""How ``tools/docs/reach/ablation.py`` varies the recipe and puts seeds together."""

from pathlib import Path
from typing import Any

import pytest
from scipy import stats

from app.errors import InvalidInput
from app.policies.configs import presets
from app.policies.configs.fields import entries
from app.policies.evaluation.statistics import clustered, wilson
from tools.docs.reach.ablation import BASE, CHANGES, SHORT, folder_of, measured, row_of, welch


def run(success: float, *, cpu_min: float) -> dict[str, Any]:
    n, good = 1000, round(1000 * success)
    ends = {"success": good, "collision": n - good, "timeout": 0}
    return {
        "rates": {end: wilson(hits, n) for end, hits in ends.items()},
        "n": n,
        "cpu_min": cpu_min,
        "updates": 9_799,
    }


@pytest.mark.parametrize("name", CHANGES)
def test_a_variant_changes_one_field_of_the_recipe(name: str) -> None:
    base = presets.resolve(BASE, presets.nested(SHORT))
    varied = presets.resolve(BASE, presets.nested({**SHORT, **CHANGES[name]}))
    pairs = zip(entries(base), entries(varied), strict=True)
    fields = [one.path for one, other in pairs if one.value != other.value]
    assert fields == list(CHANGES[name])
    assert len(fields) == (name != BASE)


def test_intervals_count_seeds() -> None:
    base = [run(one, cpu_min=4.0) for one in (0.95, 0.96, 0.94)]
    worse = [run(0.90, cpu_min=5.0), run(0.92, cpu_min=7.0)]
    row = row_of("worse", worse, base)
    assert row["n"] == 2000
    assert row["success"] == clustered([0.90, 0.92])
    assert row["against_base"] == welch([0.90, 0.92], [0.95, 0.96, 0.94])
    assert (row["worst_seed"], row["best_seed"]) == (0.90, 0.92)
    assert row["cpu_min"] == pytest.approx(6.0)
    assert row_of(BASE, base, base)["against_base"] is None


def test_the_interval_is_welchs() -> None:
    values, others = [0.90, 0.92, 0.93], [0.95, 0.96, 0.94]
    found = welch(values, others)
    assert found["low"] < found["mean"] < found["high"] < 0.0
    assert found["mean"] == pytest.approx(-0.0333333, abs=1e-6)
    variances = [stats.tvar(one) / 3 for one in (values, others)]
    freedom = sum(variances) ** 2 / sum(one**2 / 2 for one in variances)
    half = stats.t.ppf(0.975, freedom) * sum(variances) ** 0.5
    assert found["high"] - found["mean"] == pytest.approx(half)


def test_unfinished_trainings_are_not_measured(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, BASE, 2)
    folder.mkdir()
    (folder / "step-000320000.json").write_text("{}")
    with pytest.raises(InvalidInput, match="two or more seeds"):
        measured(tmp_path, (1, 2), 1)
