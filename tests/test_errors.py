import numpy as np
import pytest

from app.errors import digits, interval
from app.policies.configs import presets
from app.sim.cell_validation.units import shown


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1e18, "1000000000000000000"),
        (10_000_000, "10000000"),
        (2**63 - 1, "9223372036854775807"),
        (1700000000.033, "1700000000.033"),
        (2.80000001, "2.80000001"),
        (1e-7, "0.0000001"),
        (3.1, "3.1"),
        (20.0, "20"),
        (-0.0, "0"),
        (np.float64(0.25), "0.25"),
        (np.int64(5), "5"),
        (1e308, "1e+308"),
        (float("inf"), "inf"),
    ],
)
def test_numbers_of_rules_have_all_their_digits(value: float, text: str) -> None:
    assert digits(value) == text
    assert float(digits(value)) == float(value)


def test_intervals_and_values_of_cells_have_all_their_digits() -> None:
    assert interval(-1e6, 6.283185307179586) == "[-1000000, 6.283185307179586]"
    assert shown((2.8000001, 1e7)) == "[2.8000001, 10000000]"


def test_bounds_of_presets_have_all_their_digits() -> None:
    with pytest.raises(Exception, match=r"must lie in \[\d+, \d+\]"):
        presets.resolve("pick-td3", {"learning": {"total_steps": 10**15}})
