"""Numbers in status messages."""

import pytest

from app.live.status_messages import length_text, percent_text, value_text


@pytest.mark.parametrize(
    ("metres", "text"),
    [
        (0.0, "0 m"),
        (2e-4, "< 1 mm"),
        (0.004, "4 mm"),
        (0.0094, "9 mm"),
        (0.0096, "0.01 m"),
        (0.318, "0.32 m"),
        (12.0, "12.00 m"),
    ],
)
def test_length_is_given_in_millimetres_below_1_cm(metres: float, text: str) -> None:
    assert length_text(metres) == text


def test_values_have_true_minus_signs_and_no_negative_zero() -> None:
    assert [value_text(one) for one in (-0.631, -0.001, 3.1)] == ["\u22120.63", "0.00", "3.10"]
    assert value_text(-12.34, 1) == "\u221212.3"


def test_percent_is_set_off_by_a_space() -> None:
    assert percent_text(0.402) == "40 %"
