from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError

from app.live.command_checks import CommandMessage
from app.live.commands import MovePerson, SetPolicy
from app.sim.perception.keypoints import FARTHEST_M

MESSAGE = TypeAdapter[Any](CommandMessage)


@pytest.mark.parametrize(
    ("message", "field"),
    [
        ({"tag": "set-speed", "factor": 3}, "factor"),
        ({"tag": "set-mode", "mode": "recorded"}, "mode"),
        ({"tag": "set-anthropometry", "stature": 0.0}, "stature"),
        ({"tag": "set-anthropometry", "arms": float("nan")}, "arms"),
        ({"tag": "move-person", "pelvis": [float("inf"), 0.0, 0.0]}, "pelvis"),
        ({"tag": "move-person", "right": [0.0, -FARTHEST_M - 0.01, 0.0]}, "right"),
        ({"tag": "move-person", "left": [0.0, float("nan"), 0.0]}, "left"),
        ({"tag": "move-goal", "position": [float("nan"), 0.8, 0.3]}, "position"),
        ({"tag": "set-walking-speed", "speed": 2.5}, "speed"),
        ({"tag": "set-walking-speed", "speed": float("inf")}, "speed"),
        ({"tag": "set-motion", "name": "x", "run": -1}, "run"),
        ({"tag": "pause", "reason": "tea"}, "reason"),
    ],
)
def test_value_outside_its_range_is_refused_by_field(
    message: dict[str, Any], field: str
) -> None:
    with pytest.raises(ValidationError) as caught:
        MESSAGE.validate_python(message)
    assert caught.value.errors()[0]["loc"][:2] == (message["tag"], field)


def test_message_and_command_are_the_same() -> None:
    command = MovePerson(person=1, pelvis=(0.1, 1.2, 0.0))
    assert MESSAGE.validate_json(MESSAGE.dump_json(command)) == command


def test_loaded_object_stays_out_of_the_message() -> None:
    command = SetPolicy(checkpoint="pick").with_loaded(object())
    assert command.loaded is not None
    assert MESSAGE.dump_python(command) == {"tag": "set-policy", "checkpoint": "pick"}
