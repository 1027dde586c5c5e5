import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.read_options import UP_AXES, ReadOptions, metres
from app.sim.skeletons import _z_up


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


@pytest.mark.parametrize("up", UP_AXES)
def test_any_axis_is_turned_up_without_a_mirror(up: str) -> None:
    turned = _z_up(np.eye(3), up)
    axis = np.eye(3)["xyz".index(up[-1])] * (-1.0 if up[0] == "-" else 1.0)
    np.testing.assert_array_equal(_z_up(axis, up), [0.0, 0.0, 1.0])
    assert np.linalg.det(turned) == pytest.approx(1.0)
