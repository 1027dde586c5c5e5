"""A manifest from outside has only values that a training writes."""

import re

import numpy as np
import pytest

from app.errors import InvalidInput
from app.policies.checkpoints import checkpoint as formats
from app.policies.checkpoints import pretrained
from app.policies.checkpoints.upload import require_ranges

CONTROLS = "\n\t\x7f\x85\u2028\u2029" + "".join(
    map(chr, [*range(0x202A, 0x202F), *range(0x2066, 0x206A)])
)
GOAL = {"low": [-1.0, 0.0, 0.0], "high": [1.0, 1.0, 1.0]}


def loaded(alias, **change):
    shipped = pretrained.load(alias)
    return formats.load({**shipped.manifest, **change}, shipped.tensors)


def ranges_of(alias, **change):
    return {**pretrained.load(alias).manifest["trained_range"], **change}


@pytest.mark.parametrize("alias", pretrained.ALIASES)
def test_shipped_manifests_keep_every_rule(alias):
    require_ranges(loaded(alias).manifest)


@pytest.mark.parametrize("alias", ["pick", "reach", "sorting-e0"])
@pytest.mark.parametrize(
    "name",
    [{}, [], None, 3, "x" * 65, "a\n", *(f"a{one}b" for one in CONTROLS)],
)
def test_name_of_a_preset_is_one_line_of_text(alias, name):
    preset = {**pretrained.load(alias).manifest["preset"], "name": name}
    with pytest.raises(InvalidInput, match=r"must be text of one line") as caught:
        loaded(alias, preset=preset)
    assert caught.value.field == "manifest.preset.name"


@pytest.mark.parametrize("name", ["x" * 64, "Auswahl für Linie 2", "拾取"])
def test_short_name_in_any_language_is_kept(name):
    preset = {**pretrained.load("pick").manifest["preset"], "name": name}
    assert loaded("pick", preset=preset).manifest["preset"]["name"] == name


def test_preset_without_a_field_is_refused():
    with pytest.raises(InvalidInput, match=r"manifest\.preset = \{\} must hold the fields"):
        loaded("reach", preset={})


@pytest.mark.parametrize(
    ("field", "value"),
    [
        *((name, True) for name in ("seed", "width", "step", "updates", "act_size")),
        *((name, 1.0) for name in ("seed", "width", "step", "updates", "act_size")),
        *((name, -1) for name in ("seed", "width", "step", "updates")),
        *((name, 10**400) for name in ("seed", "width", "step", "updates", "cpu_s")),
        *(("cpu_s", value) for value in (True, None, "1", -0.5, [], np.inf, np.nan)),
        *(("versions", value) for value in (None, [], "3.11", {"python": 3.11}, {"a": None})),
        *(("commits", value) for value in (None, {}, "5b8bc9540cf0", [1], ["a", None])),
        *(("cell", value) for value in ("", "Cell", "a b", "a\n", "a" * 65)),
        *(("recalibration", value) for value in (None, [], "pick", 3)),
    ],
)
def test_values_that_no_training_writes_are_refused(field, value):
    with pytest.raises(InvalidInput) as caught:
        loaded("reach", **{field: value})
    assert caught.value.field == f"manifest.{field}"


@pytest.mark.parametrize("alias", ["pick", "reach", "sorting-e0"])
@pytest.mark.parametrize(
    ("field", "change"),
    [
        *(("outcomes", {"outcomes": n}) for n in (None, [1], 3, {"success": 1.0})),
        *(("outcomes", {"outcomes": {"success": n}}) for n in (-1, True, None, 2**63)),
        *(("from", {"from": value}) for value in (None, 3, {})),
    ],
)
def test_record_of_a_recalibration_counts_outcomes(alias, field, change):
    record = {"from": "a" * 64, "outcomes": {"success": 40, "collision": 10, "timeout": 0}}
    assert loaded(alias, recalibration=record).manifest["recalibration"] == record
    with pytest.raises(InvalidInput) as caught:
        loaded(alias, recalibration={**record, **change})
    assert caught.value.field == f"manifest.recalibration.{field}"


@pytest.mark.parametrize(
    "change",
    [
        {"seed": 2**63 - 1, "step": 0, "updates": 0},
        {"cpu_s": 0},
        {"cpu_s": 6759.6, "versions": {}, "commits": []},
    ],
)
def test_values_at_the_bounds_are_accepted(change):
    assert change.items() <= loaded("reach", **change).manifest.items()


def test_older_manifests_lack_processor_time_versions_and_commits():
    shipped = pretrained.load("reach")
    dropped = ("cpu_s", "versions", "commits")
    old = {name: value for name, value in shipped.manifest.items() if name not in dropped}
    assert formats.load(old, shipped.tensors).manifest == old


def test_a_boolean_is_no_size_of_a_group():
    layout = [[name, size == 1 or size] for name, size in loaded("reach").manifest["layout"]]
    with pytest.raises(InvalidInput, match=r"manifest\.layout\[12\] = \['clearance', True\]"):
        loaded("reach", layout=layout)


@pytest.mark.parametrize(
    ("alias", "group", "entry"),
    [
        ("pick", "goal", {"low": [0.0], "high": [1.0]}),
        ("pick", "goal", {"low": [False] * 3, "high": [True] * 3}),
        ("pick", "goal", {**GOAL, "mean": [0.0] * 3}),
        ("pick", "human_q", {"low": [0.0] * 17, "high": [1.0] * 17}),
        ("pick", "human_qd", {"low": [], "high": []}),
        ("reach", "q", {"low": [0.0] * 5, "high": [1.0] * 5}),
        ("reach", "human", {"low": [0.0] * 6, "high": [1.0] * 6}),
    ],
)
def test_a_range_has_the_length_of_its_group(alias, group, entry):
    size = formats.RANGE_SIZES[formats.purpose_of(loaded(alias).manifest)][group]
    rule = f"must hold two lists of {size} finite numbers, low and high"
    with pytest.raises(InvalidInput, match=rule) as caught:
        loaded(alias, trained_range=ranges_of(alias, **{group: entry}))
    assert caught.value.field == f"manifest.trained_range.{group}"


@pytest.mark.parametrize(
    ("alias", "group"), [("pick", "human"), ("reach", "human_q"), ("sorting-e0", "q")]
)
def test_a_range_of_another_purpose_is_refused(alias, group):
    with pytest.raises(InvalidInput, match="is not a group of the training range") as caught:
        loaded(alias, trained_range=ranges_of(alias, **{group: GOAL}))
    assert caught.value.field == f"manifest.trained_range.{group}"


def test_a_low_above_its_high_is_refused():
    swapped = {"low": GOAL["high"], "high": GOAL["low"]}
    message = "manifest.trained_range.goal.low[0] = 1.0 must be at most -1.0, its high"
    with pytest.raises(InvalidInput, match=re.escape(message)):
        loaded("pick", trained_range=ranges_of("pick", goal=swapped))


def test_a_range_of_one_value_is_accepted():
    at_rest = {"low": [0.0] * 6, "high": [0.0] * 6}
    assert loaded("pick", trained_range=ranges_of("pick", qd=at_rest))


@pytest.mark.parametrize(
    ("alias", "group"),
    [
        *(("pick", group) for group in ("q", "qd", "goal", "human_q", "human_qd")),
        *(("reach", group) for group in ("q", "qd", "goal", "human")),
    ],
)
def test_an_uploaded_policy_states_every_group(alias, group):
    ranges = ranges_of(alias)
    del ranges[group]
    found = loaded(alias, trained_range=ranges)  # short trainings have no range yet
    with pytest.raises(InvalidInput, match="must be given") as caught:
        require_ranges(found.manifest)
    assert caught.value.field == f"manifest.trained_range.{group}"


@pytest.mark.parametrize(
    ("alias", "people"), [("pick", {"human_absent": 1.0}), ("reach", {"n_people": 0})]
)
def test_a_policy_trained_without_people_has_no_range_of_them(alias, people):
    ranges = {k: one for k, one in ranges_of(alias).items() if not k.startswith("human")}
    preset = pretrained.load(alias).manifest["preset"]
    preset = {**preset, "people": preset["people"] | people}
    require_ranges(loaded(alias, trained_range=ranges, preset=preset).manifest)
