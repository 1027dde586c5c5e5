"""The protocol of the safety layer: rows, what they assume, no checkpoint."""

import pytest

from app.errors import InvalidInput
from app.policies.evaluation.registry import evaluate


@pytest.fixture(scope="module")
def result():
    return evaluate("safety-ssm", None, episodes=160, seed=3)


def test_only_rows_outside_the_assumptions_have_moving_contacts(result):
    rows = {row["name"]: row for row in result["results"]}
    assert rows["inside"]["contacts"] > 40
    assert rows["inside"]["contacts_moving"] == rows["touch-limited"]["contacts_moving"] == 0
    assert rows["no-ssm"]["contacts_moving"] > 0
    assert rows["late-tracker"]["contacts_moving"] > 0
    assert rows["inside"]["n"] == result["episodes"] == 160


def test_every_row_states_what_it_assumes_and_what_is_true(result):
    assert set(result["settings"]) == {row["name"] for row in result["results"]}
    for trials in result["settings"].values():
        for trial in trials:
            assert trial["assumed"]["human_speed [m/s]"] == 1.6
    fast = result["settings"]["fast-hands"][0]
    assert fast["true human_speed [m/s]"] == 2.5
    assert result["settings"]["fast-hands-cell"][0]["assumed"]["protective_distance [m]"] == 0.3


def test_no_checkpoint_is_named(result):
    assert "checkpoint" not in result


def test_other_protocols_ask_for_a_checkpoint():
    with pytest.raises(InvalidInput, match="checkpoint"):
        evaluate("pick-single", None, episodes=1)
