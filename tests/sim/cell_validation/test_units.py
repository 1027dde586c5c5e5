import pytest

from app.sim.cell_validation.units import numbers, shown, unit_hint
from app.sim.cells.cell import load_cell
from app.sim.cells.parts import Within

METRES, TURN = Within(-3.0, 3.0, "m"), Within(-6.28, 6.28, "rad")


@pytest.mark.parametrize(
    ("value", "within", "hint"),
    [
        (500.0, METRES, "looks like millimetres: in m that is 0.5"),
        (0.00012, Within(0.01, 0.6, "m"), "looks 1000 times too small: 0.12 m?"),
        (50.0, Within(0.002, 0.2, "s"), "looks like milliseconds: in s that is 0.05"),
        (-133.0, TURN, "looks like degrees: in rad that is -2.321"),
        (120.0, Within(0.01, 2.16, "rad/s"), "looks like degrees/s: in rad/s that is 2.094"),
        (1e9, METRES, ""),
        (1.5, Within(0.0, 1.0, ""), ""),
    ],
)
def test_unit_that_was_probably_meant_is_named(value: float, within: Within, hint: str) -> None:
    assert unit_hint(value, within) == hint


def test_every_number_of_every_part_is_held_against_its_bounds() -> None:
    cell = load_cell("sorting-e0")
    far = cell.stations[3].model_copy(update={"position": (0.0, 700.0, 0.05)})
    robot = cell.robot.model_copy(update={"qd_max": (0.5, 0.5, 3.5, 0.5, 0.5, 0.5)})
    broken = cell.model_copy(update={"stations": (far,), "robot": robot})
    assert {fault.place for fault in numbers(broken)} == {
        "stations.slot3.position[1]",
        "robot.qd_max[2]",
    }


def test_sound_cell_has_no_number_out_of_bounds() -> None:
    assert list(numbers(load_cell("shared-workspace"))) == []


def test_values_are_written_as_a_user_would() -> None:
    assert shown((0.1, 700.0, "x")) == "[0.1, 700, x]"
