import pytest

from app.errors import InvalidInput
from app.sim.read_options import ReadOptions, metres


def test_only_what_is_stated_is_told() -> None:
    assert ReadOptions().stated() == {}
    said = {"unit": "cm", "names": {"Hüfte": "pelvis"}}
    assert ReadOptions(**said).stated() == said


@pytest.mark.parametrize(
    ("unit", "length"), [("cm", 0.01), ("cmu", 0.0254 / 0.45), ("0.045", 0.045), ("1", 1.0)]
)
def test_unit_is_a_name_or_metres_per_unit(unit: str, length: float) -> None:
    assert metres(unit) == pytest.approx(length)
    assert ReadOptions(unit=unit, root_unit=unit).unit == unit


@pytest.mark.parametrize("unit", ["", "furlong", "0", "-0.01", "nan", "inf", "1e9", "CM "])
def test_unit_that_is_none_is_refused_with_the_choices(unit: str) -> None:
    with pytest.raises(InvalidInput, match=r"unit = .* must be a unit.*choices: m, cm, mm"):
        ReadOptions(unit=unit)
    with pytest.raises(InvalidInput, match="root_unit"):
        ReadOptions(root_unit=unit)


@pytest.mark.parametrize("up", ["Y", "up", "w", ""])
def test_axis_that_is_none_is_refused_with_the_choices(up: str) -> None:
    with pytest.raises(InvalidInput, match="up = .* choices: x, y, z, -x, -y, -z"):
        ReadOptions(up=up)
