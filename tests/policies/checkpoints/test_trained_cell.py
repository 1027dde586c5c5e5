"""Which cell a policy belongs to, and that it refuses every other."""

import pytest

from app.errors import BadCell, CheckpointMismatch, InvalidInput
from app.policies.checkpoints import pretrained
from app.policies.checkpoints.checkpoint import load
from app.policies.checkpoints.trained_cell import cell_of, is_for, manifest_fields
from app.policies.inference.task_selection import TaskChooser
from app.sim.cells.cell import cell_names, load_cell
from tests.policies.conftest import TINY, Recorder, preset_of
from tests.support import workshop


@pytest.fixture(scope="module")
def own_policy():
    """The policy of a tiny training in a cell of the user's own."""
    preset = preset_of("pick-td3", TINY, {"cell": "workshop", "learning.total_steps": 1024})
    return Recorder().run(preset, seed=1, cell=workshop.cell()).checkpoint


def test_shipped_cell_goes_by_its_name():
    assert manifest_fields(load_cell()) == {"cell": "pick-and-place"}
    assert cell_of({"cell": "pick-and-place"}) == load_cell()


def test_own_cell_travels_with_the_checkpoint(own_policy):
    again = load(own_policy.manifest, own_policy.tensors)
    assert cell_of(again.manifest) == workshop.cell()
    assert TaskChooser(again).cell_sha256 == workshop.cell().sha256


def test_policy_refuses_another_cell_and_a_changed_one(own_policy):
    with pytest.raises(CheckpointMismatch, match="'workshop', expected 'pick-and-place'"):
        TaskChooser(own_policy, load_cell())
    with pytest.raises(CheckpointMismatch, match="workshop as it is now"):
        TaskChooser(own_policy, workshop.cell(title="Changed"))


def test_manifest_states_the_cell_of_a_policy(own_policy):
    shipped = pretrained.load("pick").manifest
    assert is_for(own_policy.manifest, workshop.cell())
    assert not is_for(own_policy.manifest, workshop.cell(title="Changed"))
    assert not is_for(own_policy.manifest, load_cell())
    assert is_for(shipped, load_cell())
    assert not is_for(shipped, workshop.cell(name="pick-and-place"))


def test_carried_cell_is_checked_like_any_other():
    broken = workshop.definition()
    broken["robot"]["dt"] = 50.0
    with pytest.raises(BadCell, match="milliseconds") as caught:
        cell_of({"cell": "workshop", "cell_definition": broken})
    assert caught.value.field == "manifest.cell_definition.robot.dt"
    with pytest.raises(CheckpointMismatch):
        cell_of({"cell": "garage", "cell_definition": workshop.definition()})


def test_unknown_cell_without_a_definition_is_refused_with_the_shipped_ones():
    with pytest.raises(
        InvalidInput, match="must be a shipped cell where there is no"
    ) as caught:
        cell_of({"cell": "garage"})
    assert (caught.value.field, caught.value.choices) == ("manifest.cell", cell_names())


@pytest.mark.parametrize(
    ("definition", "field"),
    [
        (workshop.definition(name="No name"), "manifest.cell_definition.name"),
        (workshop.definition(lamp=1), "manifest.cell_definition.lamp"),
        ({}, "manifest.cell_definition.name"),
        (None, "manifest.cell_definition"),
        ([1], "manifest.cell_definition"),
    ],
)
def test_every_fault_of_a_definition_has_its_place_in_the_manifest(definition, field):
    with pytest.raises(BadCell) as caught:
        cell_of({"cell": "workshop", "cell_definition": definition})
    assert caught.value.field == field
    assert all(one.place.startswith("manifest.cell_definition") for one in caught.value.faults)


def test_cell_without_cubes_cannot_be_trained_in(tiny_preset):
    with pytest.raises(InvalidInput, match="cannot be used for picking"):
        Recorder().run(tiny_preset, cell=load_cell("sorting-e0"))
