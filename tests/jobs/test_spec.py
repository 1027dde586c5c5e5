import math
import re
from typing import Any

import pytest
from pydantic import ValidationError

from app.errors import InvalidInput
from app.policies.configs.presets import PRESETS
from jobs.spec import MAX_SEED, EvaluateSpec, TrainSpec, parse_spec

EVALUATE = {"kind": "evaluate", "protocol": "pick-single", "episodes": 10, "seed": 11}
WITHOUT_POLICY = EVALUATE | {"protocol": "safety-ssm"}
NARROW = {"networks": {"width": 64}}
TRAIN = {"kind": "train", "preset": "pick-td3", "seed": 1, "overrides": NARROW}
SORTING_SWEEP = {
    "kind": "sweep",
    "preset": "sorting-e0-dqn",
    "ranges": {"learning.gamma": {"low": 0.9, "high": 0.99}},
    "trials": 2,
    "objective": {"protocol": "sorting-grid", "quantity": "collision"},
}
RECORDED = {"kind": "evaluate", "protocol": "pick-mocap", "recordings": ["wave", "walk"]}


def test_training_becomes_a_job_with_its_body_unchanged() -> None:
    job = parse_spec(TRAIN).new_job()
    found = (job.kind, job.preset, job.seed, job.overrides)
    assert found == ("train", "pick-td3", 1, NARROW)
    assert job.spec == TRAIN
    assert job.total_steps == PRESETS["pick-td3"].learning.total_steps


def test_seed_and_overrides_may_be_left_out() -> None:
    spec = parse_spec({"kind": "train", "preset": "pick-td3"})
    assert isinstance(spec, TrainSpec)
    assert (spec.seed, spec.overrides) == (0, {})


@pytest.mark.parametrize(
    ("body", "field"),
    [
        (TRAIN | {"speed": 1}, "speed"),
        (TRAIN | {"protocol": "pick-single"}, "protocol"),
        (TRAIN | {"preset": None}, "preset"),
        (TRAIN | {"preset": 3}, "preset"),
        (TRAIN | {"seed": -1}, "seed"),
        (TRAIN | {"seed": MAX_SEED + 1}, "seed"),
        (TRAIN | {"seed": 1.5}, "seed"),
        (TRAIN | {"seed": True}, "seed"),
        (TRAIN | {"seed": "1"}, "seed"),
        (TRAIN | {"overrides": [1]}, "overrides"),
        (EVALUATE | {"preset": "pick-td3"}, "preset"),
        (EVALUATE | {"protocol": None}, "protocol"),
        (EVALUATE | {"checkpoint": 7}, "checkpoint"),
        (EVALUATE | {"checkpoint": ""}, "checkpoint"),
        (EVALUATE | {"episodes": 0}, "episodes"),
        (EVALUATE | {"episodes": 1.5}, "episodes"),
        (RECORDED | {"recordings": "wave"}, "recordings"),
        (RECORDED | {"recordings": {"wave": 1}}, "recordings"),
        (RECORDED | {"recordings": None}, "recordings"),
        (RECORDED | {"recordings": ["wave", 3]}, "recordings.1"),
        (RECORDED | {"recordings": [""]}, "recordings.0"),
        (RECORDED | {"recordings": [str(k) for k in range(33)]}, "recordings"),
    ],
)
def test_field_of_a_wrong_type_or_name_is_named(body: dict[str, Any], field: str) -> None:
    with pytest.raises(ValidationError) as caught:
        parse_spec(body)
    (error,) = caught.value.errors()
    assert ".".join(map(str, error["loc"])) == f"{body['kind']}.{field}"


@pytest.mark.parametrize("kind", ["dream", None, ["train"]])
def test_unknown_kind_is_refused(kind: object) -> None:
    with pytest.raises(ValidationError, match="kind"):
        parse_spec(TRAIN | {"kind": kind})


@pytest.mark.parametrize(
    ("body", "field", "rule"),
    [
        (TRAIN | {"preset": "pick-td4"}, "preset", "is not a preset; choices: pick-td3"),
        (TRAIN | {"overrides": {"wdith": 64}}, "overrides.wdith", "is not a field"),
        (TRAIN | {"overrides": {"networks": {"width": 7}}}, "overrides.networks.width", "in"),
        (
            TRAIN | {"overrides": {"learning": {"gamma": math.nan}}},
            "overrides.learning.gamma",
            "must be finite",
        ),
        (
            EVALUATE | {"protocol": "safety-ssm", "checkpoint": "pick"},
            "checkpoint",
            "must not be",
        ),
        (EVALUATE | {"protocol": "pick-all"}, "protocol", "is not a protocol; choices: pick-"),
        (EVALUATE | {"episodes": 10**9}, "episodes", "must lie in"),
        (RECORDED | {"recordings": []}, "recordings", "at least one .* for pick-mocap"),
        ({"kind": "evaluate", "protocol": "pick-mocap"}, "recordings", "at least one"),
        (RECORDED | {"recordings": ["a", "b", "a"]}, r"recordings\[2\]", "be named once"),
        (RECORDED | {"protocol": "pick-single"}, "recordings", "must not be given to pick-"),
        (SORTING_SWEEP, "objective.quantity", "state; choices: success, timeout"),
    ],
)
def test_broken_rule_names_field_and_rule(body: dict[str, Any], field: str, rule: str) -> None:
    with pytest.raises(InvalidInput, match=rule) as caught:
        parse_spec(body).new_job()
    assert re.fullmatch(field, caught.value.field)


@pytest.mark.parametrize("seconds", [0.6, 4e7])
def test_limits_of_a_time_budget_have_their_unit(seconds: float) -> None:
    with pytest.raises(ValidationError, match=r"must lie in \[1, 31622400\] s "):
        parse_spec(TRAIN | {"time_budget_s": seconds})


def test_evaluation_beside_recorded_people_names_stored_recordings() -> None:
    spec = parse_spec(RECORDED)
    assert isinstance(spec, EvaluateSpec)
    assert spec.recordings == ["wave", "walk"]
    assert spec.new_job().spec == {**RECORDED, "checkpoint": "pick"}


@pytest.mark.parametrize(
    ("protocol", "checkpoint"),
    [("pick-single", "pick"), ("sorting-grid", "sorting-e0"), ("sorting-people", "pick")],
)
def test_default_checkpoint_is_the_protocols_own(protocol: str, checkpoint: str) -> None:
    job = parse_spec({"kind": "evaluate", "protocol": protocol, "seed": 11}).new_job()
    assert (job.kind, job.seed, job.spec["checkpoint"]) == ("evaluate", 11, checkpoint)


def test_episodes_of_a_pair_are_fewer_than_those_of_a_whole_protocol() -> None:
    body = {"kind": "evaluate", "protocol": "sorting-grid", "episodes": 10_001}
    with pytest.raises(InvalidInput, match=r"\[1, 10000\]"):
        parse_spec(body).new_job()
    parse_spec({**body, "protocol": "pick-single"}).new_job()


def test_evaluation_without_policy_has_no_checkpoint() -> None:
    assert (
        parse_spec(EVALUATE | {"protocol": "safety-ssm"}).new_job().spec["checkpoint"] is None
    )


@pytest.mark.parametrize("letter", ["\n", "\x7f", "\x85", "\u2028", "\u202e", "\u2066"])
def test_name_is_one_line_in_one_direction(letter: str) -> None:
    with pytest.raises(ValidationError, match="name"):
        parse_spec(TRAIN | {"name": f"a{letter}b"})
    with pytest.raises(ValidationError, match="name"):
        parse_spec(TRAIN | {"name": f"a{letter}"})
    assert parse_spec(TRAIN | {"name": "größer 大 😀"}).new_job().name == "größer 大 😀"
