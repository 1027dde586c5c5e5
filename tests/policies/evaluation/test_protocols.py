"""What a protocol can be given, and what it tells."""

import pytest

from app.errors import InvalidInput
from app.policies import pretrained
from app.policies.evaluation.protocols import PROTOCOLS, WITH_MOTIONS, evaluate
from tests.sim.recorded_person import working
from tests.sim.working_people import run_of


def test_recorded_motion_without_any_is_refused():
    with pytest.raises(InvalidInput, match="must hold at least one motion") as caught:
        evaluate("pick-mocap", pretrained.load("pick"), episodes=1)
    assert caught.value.field == "motions"


@pytest.mark.parametrize("name", sorted(set(PROTOCOLS) - WITH_MOTIONS))
def test_motions_are_refused_where_none_are_taken(name):
    run = run_of(working(60), name="wave")
    with pytest.raises(InvalidInput, match=f"'wave'.*must not be given to {name}") as caught:
        evaluate(name, pretrained.load("pick"), episodes=1, motions=(run,))
    assert caught.value.choices == ("pick-mocap",)


@pytest.mark.parametrize("name", ["pick-single", "pick-choice", "safety-ssm"])
def test_rows_are_told_in_order_and_are_those_of_the_result(name):
    told = []
    result = evaluate(
        name, pretrained.load("pick"), episodes=4, on_row=lambda *what: told.append(what)
    )
    n = len(result["results"])
    assert [(done, total) for done, total, _ in told] == [(k + 1, n) for k in range(n)]
    assert [row for _, _, row in told] == result["results"]
