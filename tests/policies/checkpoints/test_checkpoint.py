"""Checkpoints are data: whatever is wrong with one is named, and nothing is executed."""

import json
import pickle

import numpy as np
import pytest

from app.errors import CheckpointMismatch, InvalidInput
from app.policies.checkpoints import checkpoint as formats
from app.policies.checkpoints import pretrained


@pytest.fixture(scope="module")
def shipped():
    return pretrained.load("pick")


def test_packing_and_loading_gives_the_same_arrays_and_id(shipped):
    again = formats.pack(json.loads(json.dumps(shipped.manifest)), shipped.arrays())
    assert again.sha256 == shipped.sha256
    for name, array in shipped.arrays().items():
        assert np.array_equal(array, again.arrays()[name])


def test_one_changed_number_changes_the_id(shipped):
    arrays = {name: array.copy() for name, array in shipped.arrays().items()}
    arrays["actor.net.0.bias"][0] += 1.0
    assert formats.pack(shipped.manifest, arrays).sha256 != shipped.sha256


@pytest.mark.parametrize("field", sorted(formats.REQUIRED))
def test_a_missing_field_is_named(shipped, field):
    manifest = {key: value for key, value in shipped.manifest.items() if key != field}
    with pytest.raises(InvalidInput, match=f"manifest.{field}"):
        formats.load(manifest, shipped.tensors)


def test_another_format_is_refused(shipped):
    with pytest.raises(CheckpointMismatch, match="format"):
        formats.load({**shipped.manifest, "format": "tandem-checkpoint/9"}, shipped.tensors)


def test_a_pickle_is_refused_and_not_run(shipped, tmp_path):
    class Bomb:
        def __reduce__(self):
            return (tmp_path.joinpath("ran").write_text, ("ran",))

    checkpoint = formats.load(shipped.manifest, pickle.dumps(Bomb()))
    with pytest.raises(InvalidInput, match="safetensors"):
        checkpoint.arrays()
    assert not (tmp_path / "ran").exists()


def test_non_finite_weights_are_refused(shipped):
    arrays = {name: array.copy() for name, array in shipped.arrays().items()}
    arrays["critic.q1.0.weight"][0, 0] = np.nan
    with pytest.raises(InvalidInput, match=r"critic\.q1\.0\.weight"):
        formats.pack(shipped.manifest, arrays).arrays()


@pytest.mark.parametrize(
    ("values", "text"),
    [
        (np.float64([1e300]), r"= 1e\+300 must be at most 3.403e\+38"),
        (np.array([1 + 1j], dtype=np.complex64), "= 'complex64' must be real floating-point"),
        (np.int64([1]), "= 'int64' must be real floating-point numbers; choices: F16, F32"),
        (np.array([True]), "= 'bool' must be real"),
    ],
)
def test_weights_that_no_network_has_are_refused(shipped, values, text):
    arrays = {**shipped.arrays(), "critic.q1.0.bias": values}
    with pytest.raises(InvalidInput, match=rf"tensors\.critic\.q1\.0\.bias {text}"):
        formats.pack(shipped.manifest, arrays).arrays()


@pytest.mark.parametrize("kind", ["BF16", "F8_E4M3"])
def test_a_type_that_numpy_lacks_is_named(shipped, kind):
    size = 8 if kind == "BF16" else 4
    tensor = {"dtype": kind, "shape": [4], "data_offsets": [0, size]}
    head = json.dumps({"actor.net.0.bias": tensor}).encode()
    content = len(head).to_bytes(8, "little") + head + bytes(size)
    checkpoint = formats.load(shipped.manifest, content)
    with pytest.raises(InvalidInput, match=f"tensors = '{kind}' is a type that is not read"):
        checkpoint.arrays()


def test_empty_tensors_and_half_precision_are_read(shipped):
    arrays = {"a": np.zeros(0, np.float32), "b": np.array([65504.0], np.float16)}
    assert formats.pack(shipped.manifest, arrays).arrays()["b"][0] == 65504.0


def test_checkpoint_of_another_kind_or_too_large_is_refused(shipped):
    with pytest.raises(InvalidInput, match=r"manifest\.kind = 'resume' must be policy"):
        formats.load({**shipped.manifest, "kind": "resume"}, shipped.tensors)
    large = bytes(formats.MAX_BYTES + 1)
    with pytest.raises(InvalidInput, match=f"must not exceed {formats.MAX_BYTES} bytes"):
        formats.load(shipped.manifest, large)


@pytest.mark.parametrize(
    "group", [1, "q", [], ["q"], ["q", "5"], ["q", 0], ["q", 1.0], ["q", 5, 5], [["q"], 5]]
)
def test_a_layout_without_names_and_sizes_is_refused(shipped, group):
    layout = [*shipped.manifest["layout"], group]
    with pytest.raises(InvalidInput, match=rf"manifest\.layout\[{len(layout) - 1}\] = "):
        formats.load({**shipped.manifest, "layout": layout}, shipped.tensors)


@pytest.mark.parametrize("value", ["much", 10**400, float("nan"), float("inf"), None])
def test_a_range_of_other_than_finite_numbers_is_refused(shipped, value):
    ranges = {"q": {"low": [0.0], "high": [value]}}
    with pytest.raises(InvalidInput, match="trained_range.q"):
        formats.load({**shipped.manifest, "trained_range": ranges}, shipped.tensors)


def test_a_shipped_checkpoint_is_small_and_has_a_card(shipped):
    assert len(shipped.tensors) < 4 * 1024 * 1024


def test_policy_for_another_purpose_is_refused(shipped):
    formats.require_purpose(shipped, formats.CHOOSING)
    with pytest.raises(CheckpointMismatch, match="purpose is 'choosing tasks'"):
        formats.require_purpose(shipped, formats.SORTING)


@pytest.mark.parametrize("layout", [[["clutter", 4], ["towers", 8]], [[], "x", ["towers", 1]]])
def test_policy_that_sees_towers_sorts(shipped, layout):
    assert formats.purpose_of({**shipped.manifest, "layout": layout}) == formats.SORTING
