import pytest

from app.errors import InvalidInput
from app.sim.mocap.read_options import ReadOptions, metres, name_map


def test_only_stated_options_are_listed() -> None:
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


def test_name_map_is_read_from_pairs() -> None:
    pairs = ["Bip01 L Hand=wrist_l", " Zeit = t = time ", "/jointset/a/b/value=arm_flex_r"]
    assert name_map(pairs) == {
        "Bip01 L Hand": "wrist_l",
        "Zeit = t": "time",
        "/jointset/a/b/value": "arm_flex_r",
    }


@pytest.mark.parametrize(
    ("pairs", "text"),
    [
        (["wrist"], "map = 'wrist' must be theirs=ours"),
        (["=wrist_l"], "must be theirs=ours"),
        (["a="], "must be theirs=ours"),
        ([""], "must be theirs=ours"),
        (["a\0b=wrist_l"], "must have only characters that can be shown"),
        (["a=wrist_l", "a=wrist_r"], "map = 'a=wrist_r' must map a name once"),
        ([f"{k}=wrist_l" for k in range(101)], "must be at most 100"),
    ],
)
def test_pairs_that_are_no_map_are_refused(pairs: list[str], text: str) -> None:
    with pytest.raises(InvalidInput, match=text):
        name_map(pairs)


def test_two_names_for_one_of_ours_are_refused() -> None:
    with pytest.raises(InvalidInput, match="'a=elbow_l' must be the only name for elbow_l"):
        ReadOptions(names={"a": "elbow_l", "b": "elbow_l"})
