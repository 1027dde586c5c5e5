"""The choice of an action is checked when it is made, by name."""

import pytest

from app.errors import InvalidInput
from app.sim.robot.actions import ActionSettings
from app.sim.robot.kernels.actions import COEFFICIENT, MYOPIC, SPEED, VIABLE


def test_default_is_the_viable_speed_of_degree_two() -> None:
    assert ActionSettings().rule() == (2, VIABLE, SPEED)


def test_names_become_numbers_of_the_kernels() -> None:
    settings = ActionSettings(degree=2, bounds="one-step", meaning="coefficient")
    assert settings.rule() == (2, MYOPIC, COEFFICIENT)


@pytest.mark.parametrize(
    ("choice", "field"),
    [
        ({"degree": 4}, "degree"),
        ({"bounds": "none"}, "bounds"),
        ({"meaning": "torque"}, "meaning"),
        ({"degree": 3, "bounds": "one-step"}, "bounds"),
    ],
)
def test_a_choice_that_does_not_exist_is_refused_by_name(choice: dict, field: str) -> None:
    with pytest.raises(InvalidInput) as refused:
        ActionSettings(**choice)
    assert refused.value.field == field
