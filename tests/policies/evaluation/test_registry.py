"""Tests of the registry: inputs and reported rows of protocols."""

import pytest

from app.errors import InvalidInput
from app.policies.checkpoints import pretrained
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.configs.reach import AUTHORS
from app.policies.evaluation.pick import case_variants, cases
from app.policies.evaluation.pick.people import SAMPLE_S
from app.policies.evaluation.registry import (
    MAX_SORTING_EPISODES,
    OF_CHOICE,
    OF_REACHING,
    OF_SORTING,
    PROTOCOLS,
    WITH_MOTIONS,
    WITH_OR_WITHOUT_MOTIONS,
    check_task,
    default_checkpoint,
    evaluate,
    most_episodes,
)
from tests.policies.evaluation.sorting_players import untrained
from tests.policies.untrained import shipped_pick_of, untrained_reach
from tests.sim.recorded_person import working
from tests.sim.working_people import run_of


def test_recorded_motion_without_any_is_refused():
    with pytest.raises(InvalidInput, match="must hold at least one motion") as caught:
        evaluate("pick-mocap", pretrained.load("pick"), episodes=1)
    assert caught.value.field == "motions"


@pytest.mark.parametrize(
    "name", sorted(set(PROTOCOLS) - WITH_MOTIONS - WITH_OR_WITHOUT_MOTIONS)
)
def test_motions_are_refused_where_none_are_taken(name):
    run = run_of(working(60), name="wave")
    with pytest.raises(InvalidInput, match=f"'wave'.*must not be given to {name}") as caught:
        evaluate(name, pretrained.load("pick"), episodes=1, motions=(run,))
    assert set(caught.value.choices) == WITH_MOTIONS | WITH_OR_WITHOUT_MOTIONS


@pytest.mark.parametrize("name", ["pick-single", "pick-choice", "safety-ssm"])
def test_rows_are_reported_in_order_and_are_those_of_the_result(name):
    reported = []
    policy = None if name == "safety-ssm" else pretrained.load("pick")
    result = evaluate(name, policy, episodes=4, on_row=lambda *what: reported.append(what))
    n = len(result["results"])
    assert [(done, total) for done, total, _ in reported] == [(k + 1, n) for k in range(n)]
    assert [row for _, _, row in reported] == result["results"]


def test_a_protocol_without_policy_takes_no_checkpoint():
    with pytest.raises(InvalidInput, match="must not be given to safety-ssm") as caught:
        evaluate("safety-ssm", pretrained.load("pick"), episodes=1)
    assert caught.value.field == "checkpoint"


def fitting(error: InvalidInput) -> set[str]:
    """Protocols that the rule of an unfit checkpoint lists; the choices are no checkpoints."""
    assert error.choices == ()
    return set(error.rule.partition("protocols of this one: ")[2].split(", "))


def picking() -> Checkpoint:
    return pretrained.load("pick")


def reaching() -> Checkpoint:
    return untrained_reach(width=16)


@pytest.mark.parametrize(
    ("name", "wanted", "policy", "value"),
    [
        *((name, "sorts", picking, "pick-td3") for name in sorted(OF_SORTING)),
        *((name, "reaches goals", picking, "pick-td3") for name in sorted(OF_REACHING)),
        ("pick-single", "picks", untrained, "sorting-e0-dqn"),
        ("sorting-people", "picks", untrained, "sorting-e0-dqn"),
        ("pick-single", "picks", reaching, "reach-td3"),
        ("sorting-grid", "sorts", reaching, "reach-td3"),
    ],
)
def test_a_policy_of_another_scenario_is_refused(name, wanted, policy, value):
    with pytest.raises(
        InvalidInput, match=f"must be a policy that {wanted} for {name}"
    ) as found:
        evaluate(name, policy(), episodes=1)
    assert (found.value.field, found.value.value) == ("checkpoint", value)
    if policy is picking:
        assert not fitting(found.value) & (OF_SORTING | OF_REACHING)
    else:
        assert fitting(found.value) == (OF_SORTING if policy is untrained else OF_REACHING)


@pytest.mark.parametrize("name", ["pick-cases", "pick-case-variants"])
def test_case_studies_are_of_one_cell(name):
    shipped = pretrained.load("pick")
    elsewhere = Checkpoint({**shipped.manifest, "cell": "another"}, shipped.tensors)
    with pytest.raises(InvalidInput, match=f"of the cell 'pick-and-place' for {name}"):
        evaluate(name, elsewhere, episodes=1)


@pytest.mark.parametrize("name", sorted(OF_CHOICE))
def test_choices_need_a_cell_with_as_many_stations_as_they_offer(name):
    two = shipped_pick_of("cube0", "dock1").manifest
    lack = "its cell has 2 cubes and docks, of which 3 are needed"
    with pytest.raises(InvalidInput, match=f"for {name}: {lack}"):
        check_task(name, two, "mine")
    check_task(name, shipped_pick_of("cube0", "cube1", "dock1").manifest, "mine")
    check_task("pick-single", two, "mine")


def test_search_of_avoidable_contacts_is_of_policies_that_contacts_end():
    manifest = {**untrained_reach(width=16).manifest, "preset": AUTHORS.model_dump()}
    with pytest.raises(InvalidInput, match="whose episodes end at contacts"):
        check_task("reach-oracle", manifest, "authors")
    check_task("reach-smoothness", manifest, "authors")


def test_comparison_with_planners_is_of_policies_within_the_joint_limits_of_the_cell():
    manifest = {**untrained_reach(width=16).manifest, "preset": AUTHORS.model_dump()}
    rule = "trained within the joint limits of its cell for reach-ssm"
    with pytest.raises(InvalidInput, match=rule):
        check_task("reach-ssm", manifest, "authors")


@pytest.mark.parametrize("name", sorted(OF_REACHING))
def test_presets_of_uploaded_policies_may_leave_out_fields(name):
    manifest = {**untrained_reach(width=16).manifest, "preset": {"name": "mine"}}
    check_task(name, manifest, "mine")


@pytest.mark.parametrize(
    ("name", "together"), [("pick-cases", 1), ("pick-case-variants", case_variants.TOGETHER)]
)
def test_motions_that_case_studies_store_fit_into_memory(name, together):
    poses = together * most_episodes(name) * cases.TRACK_S / SAMPLE_S
    assert 18 * 8 * poses < 0.5e9


def test_every_protocol_has_a_checkpoint_and_a_most_number_of_episodes_of_its_own():
    assert default_checkpoint("sorting-grid") == "sorting-e0"
    assert default_checkpoint("pick-choice") == "pick"
    assert default_checkpoint("sorting-people") == "pick"
    assert most_episodes("sorting-tests") == MAX_SORTING_EPISODES < most_episodes("pick-single")
    with pytest.raises(InvalidInput, match="10000"):
        evaluate("sorting-grid", untrained(), episodes=MAX_SORTING_EPISODES + 1)


@pytest.mark.parametrize(("name", "n_rows"), [("sorting-grid", 6), ("sorting-tests", 12)])
def test_a_sorting_result_states_task_policy_and_seed(name, n_rows):
    policy = untrained()
    result = evaluate(name, policy, episodes=1, seed=8)
    assert (result["protocol"], result["seed"], result["episodes"]) == (name, 8, 1)
    assert result["checkpoint"] == policy.sha256
    assert len(result["results"]) == n_rows
    settings = result["settings"]
    assert (settings["cell"], settings["n_slots"], settings["horizon_attempts"]) == (
        "sorting-e0",
        10,
        40,
    )
    if name == "sorting-grid":
        assert len(result["results"][0]["pairs"]) == settings["pairs"] == 55
    with_fallback = [
        row for row in result["results"] if row["name"].endswith("-planner-fallback")
    ]
    assert all(row["success"]["mean"] == 1.0 for row in with_fallback)
