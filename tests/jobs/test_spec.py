import math
import re
from typing import Any

import pytest

from app.errors import InvalidInput, NotFound
from app.policies.configs.presets import PRESETS
from jobs.spec import MAX_SEED, EvaluateSpec, TrainSpec, new_job, parse_spec

EVALUATE = {"kind": "evaluate", "protocol": "pick-single", "episodes": 10, "seed": 11}
TRAIN = {
    "kind": "train",
    "preset": "pick-td3",
    "seed": 1,
    "overrides": {"networks": {"width": 64}},
}


def test_training_becomes_a_job_with_its_body_unchanged() -> None:
    job = new_job(TRAIN)
    assert (job.kind, job.preset, job.seed, job.overrides) == (
        "train",
        "pick-td3",
        1,
        {"networks": {"width": 64}},
    )
    assert job.spec == TRAIN
    assert job.total_steps == PRESETS["pick-td3"].learning.total_steps


def test_seed_and_overrides_may_be_left_out() -> None:
    spec = parse_spec({"kind": "train", "preset": "pick-td3"})
    assert isinstance(spec, TrainSpec)
    assert (spec.seed, spec.overrides) == (0, {})


@pytest.mark.parametrize(
    ("change", "field", "rule"),
    [
        ({"kind": "dream"}, "kind", "must be a kind of job"),
        ({"kind": None}, "kind", "must be a kind of job"),
        ({"kind": ["train"]}, "kind", "must be a kind of job"),
        ({"speed": 1}, "speed", "is no field of a job of kind train"),
        ({"protocol": "pick-single"}, "protocol", "is no field of a job of kind train"),
        ({"preset": None}, "preset", "must be a name"),
        ({"preset": 3}, "preset", "must be a name"),
        ({"seed": -1}, "seed", "must be an integer in"),
        ({"seed": MAX_SEED + 1}, "seed", "must be an integer in"),
        ({"seed": 1.5}, "seed", "must be an integer in"),
        ({"seed": True}, "seed", "must be an integer in"),
        ({"seed": "1"}, "seed", "must be an integer in"),
        ({"overrides": [1]}, "overrides", "must be an object"),
        ({"overrides": {"wdith": 64}}, "overrides.wdith", "is no field"),
        ({"overrides": {"networks": {"width": 7}}}, "overrides.networks.width", "must lie in"),
        (
            {"overrides": {"learning": {"gamma": math.nan}}},
            "overrides.learning.gamma",
            "must be finite",
        ),
    ],
)
def test_bad_training_names_field_and_rule(
    change: dict[str, Any], field: str, rule: str
) -> None:
    with pytest.raises(InvalidInput, match=rule) as caught:
        new_job(TRAIN | change)
    assert caught.value.field == field


def test_unknown_preset_names_the_known() -> None:
    with pytest.raises(NotFound, match="no preset 'pick-td4'; known: pick-td3"):
        new_job(TRAIN | {"preset": "pick-td4"})


def test_unknown_field_names_the_choices() -> None:
    with pytest.raises(InvalidInput) as caught:
        new_job(TRAIN | {"speed": 1})
    assert caught.value.choices == ("kind", "preset", "seed", "overrides")


def test_evaluation_measures_the_shipped_checkpoint_unless_told_otherwise() -> None:
    job = new_job(EVALUATE)
    assert (job.kind, job.seed, job.spec) == ("evaluate", 11, EVALUATE)
    assert parse_spec(EVALUATE) == EvaluateSpec(
        protocol="pick-single", checkpoint="pick", episodes=10, seed=11
    )


@pytest.mark.parametrize(
    ("change", "field", "rule"),
    [
        ({"preset": "pick-td3"}, "preset", "is no field of a job of kind evaluate"),
        ({"protocol": "pick-everything"}, "protocol", "must name a protocol"),
        ({"protocol": None}, "protocol", "must be a name"),
        ({"checkpoint": 7}, "checkpoint", "must be a name"),
        ({"checkpoint": ""}, "checkpoint", "must be a name"),
        ({"episodes": 0}, "episodes", "must be an integer in"),
        ({"episodes": 10**9}, "episodes", "must be an integer in"),
        ({"episodes": 1.5}, "episodes", "must be an integer in"),
    ],
)
def test_bad_evaluation_names_field_and_rule(
    change: dict[str, Any], field: str, rule: str
) -> None:
    with pytest.raises(InvalidInput, match=rule) as caught:
        new_job(EVALUATE | change)
    assert caught.value.field == field


MOCAP = {"kind": "evaluate", "protocol": "pick-mocap", "motions": ["wave", "walk"]}


def test_evaluation_beside_recorded_people_names_stored_motions() -> None:
    assert new_job(MOCAP).spec == MOCAP
    spec = parse_spec(MOCAP)
    assert isinstance(spec, EvaluateSpec)
    assert spec.motions == ("wave", "walk")
    assert parse_spec(EVALUATE | {"motions": []}) == parse_spec(EVALUATE)


@pytest.mark.parametrize(
    ("change", "field", "rule"),
    [
        ({"motions": []}, "motions", "must hold at least one motion for pick-mocap"),
        ({"motions": "wave"}, "motions", "must be a list of names"),
        ({"motions": {"wave": 1}}, "motions", "must be a list of names"),
        ({"motions": None}, "motions", "must be a list of names"),
        ({"motions": ["wave", 3]}, r"motions\[1\]", "must be the name of a stored motion"),
        ({"motions": [""]}, r"motions\[0\]", "must be the name of a stored motion"),
        ({"motions": ["a", "b", "a"]}, r"motions\[2\]", "must be named once"),
        ({"motions": [str(k) for k in range(33)]}, "motions", "must be at most 32 names"),
        (
            {"protocol": "pick-single"},
            "motions",
            "must not be given to pick-single.*pick-mocap",
        ),
    ],
)
def test_bad_motions_of_an_evaluation_name_field_and_rule(
    change: dict[str, Any], field: str, rule: str
) -> None:
    with pytest.raises(InvalidInput, match=rule) as caught:
        new_job(MOCAP | change)
    assert re.fullmatch(field, caught.value.field)


def test_evaluation_beside_recorded_people_without_motions_is_refused() -> None:
    with pytest.raises(InvalidInput, match="must hold at least one motion for pick-mocap"):
        new_job({"kind": "evaluate", "protocol": "pick-mocap"})


@pytest.mark.parametrize(
    ("protocol", "checkpoint"),
    [("pick-single", "pick"), ("sorting-grid", "sorting-e0"), ("sorting-tests", "sorting-e0")],
)
def test_a_protocol_measures_its_own_policy_unless_another_is_named(
    protocol: str, checkpoint: str
) -> None:
    spec = parse_spec({"kind": "evaluate", "protocol": protocol})
    assert isinstance(spec, EvaluateSpec)
    assert (spec.protocol, spec.checkpoint) == (protocol, checkpoint)


def test_episodes_of_a_pair_are_fewer_than_those_of_a_whole_protocol() -> None:
    body = {"kind": "evaluate", "protocol": "sorting-grid", "episodes": 10_001}
    with pytest.raises(InvalidInput, match=r"\[1, 10000\]"):
        parse_spec(body)
    parse_spec({**body, "protocol": "pick-single"})
