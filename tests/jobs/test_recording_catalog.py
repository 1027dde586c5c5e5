from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from app.errors import BadRecording, Conflict, InvalidInput, NotFound
from app.sim.mocap.importer import Motion, read_motion
from app.sim.mocap.read_options import ReadOptions
from app.store.engine import Store
from app.store.recordings import put_recording
from app.store.records import NewRecording
from jobs import recording_catalog
from jobs.import_process import import_here
from jobs.recording_catalog import RecordingCatalog
from jobs.recording_format import packed
from tests.sim.mocap.test_importer import CLIPS, with_leap
from tests.sim.recorded_person import bvh_text, csv_text, working

CLIP = csv_text(working(100)).encode()


@pytest.fixture
def catalog(store: Store) -> RecordingCatalog:
    return RecordingCatalog(store)


def same(a: tuple[Motion, ...], b: tuple[Motion, ...]) -> bool:
    """Whether runs are the same to the last bit, in all that they say."""
    return len(a) == len(b) and all(
        np.array_equal(getattr(one, part), getattr(other, part))
        for one, other in zip(a, b, strict=True)
        for part in Motion.__slots__
    )


def test_runs_come_back_as_they_were_imported(store: Store, catalog: RecordingCatalog) -> None:
    content = with_leap(slice(100, 103)).encode()
    _, new = catalog.add(content, "leap.bvh")
    found = read_motion(content, "leap.bvh")
    assert new and len(found.runs) == 2
    assert same(catalog.get("leap"), found.runs)
    assert same(RecordingCatalog(store).get("leap"), found.runs)


def test_record_says_what_was_found(catalog: RecordingCatalog) -> None:
    record, _ = catalog.add(bvh_text(working(200)).encode(), "some one.bvh")
    assert (record.name, record.n_runs, record.n_frames) == ("some-one", 1, 200)
    assert record.summary["error_mm"]["wrists"]["p99"] < 1.0
    assert record.summary["body_m"]["forearm_r"] == pytest.approx(0.26)
    assert record.detail is not None
    assert record.detail["clean_runs"][0]["last"] == 199
    assert catalog.all() == (replace(record, detail=None),)


@pytest.mark.parametrize("file_name", ["clip.pdf", "clip", "clip.bvh.zip", ".bvh"])
def test_file_of_another_kind_is_refused_before_it_is_imported(
    store: Store, file_name: str
) -> None:
    def never(*_: object) -> NewRecording:
        raise AssertionError

    with pytest.raises(
        InvalidInput, match=r"must end with \.bvh|must be given|must name a file"
    ):
        RecordingCatalog(store, never).add(CLIP, file_name)


def test_same_file_again_is_not_new_and_is_not_imported_again(store: Store) -> None:
    calls: list[str] = []

    def counted(
        content: bytes, file_name: str, name: str, sha256: str, options: ReadOptions
    ) -> NewRecording:
        calls.append(file_name)
        return import_here(content, file_name, name, sha256, options)

    catalog = RecordingCatalog(store, counted)
    first, _ = catalog.add(CLIP, "nod.csv")
    assert catalog.add(CLIP, "Nod.csv") == (first, False)
    assert calls == ["nod.csv"]


def test_same_file_with_other_options_is_another_recording(catalog: RecordingCatalog) -> None:
    clip, metres = bvh_text(working(100), unit=1.0).encode(), ReadOptions(unit="m")
    first, _ = catalog.add(clip, "nod.bvh", options=metres)
    assert first.summary["options"] == {"unit": "m"}
    assert catalog.add(clip, "nod.bvh", options=metres) == (first, False)
    with pytest.raises(Conflict, match="was read from this file with unit = m: remove it"):
        catalog.add(clip, "nod.bvh", options=ReadOptions(unit="1.1"))
    larger, new = catalog.add(clip, "nod.bvh", "large", ReadOptions(unit="1.1"))
    assert new and larger.summary["body_m"]["forearm_r"] == pytest.approx(0.286)


def test_same_file_with_a_wrong_ending_is_refused_all_the_same(
    catalog: RecordingCatalog,
) -> None:
    catalog.add(CLIP, "nod.csv")
    with pytest.raises(BadRecording, match="must end with"):
        catalog.add(CLIP, "nod.txt")


def test_another_file_under_the_name_is_a_conflict(catalog: RecordingCatalog) -> None:
    catalog.add(CLIP, "nod.csv")
    other = csv_text(working(100, seed=1)).encode()
    with pytest.raises(Conflict, match="'nod' from another file"):
        catalog.add(other, "nod.csv")
    assert catalog.add(other, "nod.csv", "nod-2")[1]
    assert catalog.names() == ("nod", "nod-2")


def test_arrays_of_a_stored_recording_cannot_be_written_to(catalog: RecordingCatalog) -> None:
    catalog.add(CLIP, "nod.csv")
    (run,) = catalog.get("nod")
    for array in (run.times, run.q, run.pelvis_z):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_recording_is_kept_in_memory_until_another_takes_its_name(
    store: Store, catalog: RecordingCatalog
) -> None:
    catalog.add(CLIP, "nod.csv")
    runs = catalog.get("nod")
    assert catalog.get("nod") is runs
    elsewhere = RecordingCatalog(store)
    elsewhere.remove("nod")
    other = csv_text(working(120, seed=1)).encode()
    elsewhere.add(other, "nod.csv")
    assert same(catalog.get("nod"), read_motion(other, "nod.csv").runs)


def test_memory_is_given_back_beyond_so_many_frames(
    catalog: RecordingCatalog, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recording_catalog, "MAX_CACHED_FRAMES", 150)
    for name in ("a", "b"):
        catalog.add(CLIP, "nod.csv", name)
    first, second = catalog.get("a"), catalog.get("b")
    assert catalog.get("b") is second
    assert catalog.get("a") is not first


def test_unknown_recording_names_the_known_ones(catalog: RecordingCatalog) -> None:
    catalog.add(CLIP, "nod.csv")
    for ask in (catalog.get, catalog.with_runs, catalog.remove):
        for name in ("walk", "../nod", "nod\n", ""):
            with pytest.raises(NotFound, match="known: nod"):
                ask(name)


def test_runs_of_several_recordings_are_called_as_they_are_stored(
    catalog: RecordingCatalog,
) -> None:
    catalog.add(CLIP, "nod.csv", "first")
    catalog.add(csv_text(working(120, seed=1)).encode(), "nod.csv", "second")
    found = catalog.runs_of(("second", "first"))
    assert [(run.name, len(run.times)) for run in found] == [("second", 120), ("first", 100)]
    assert catalog.runs_of(()) == ()


def test_recordings_that_are_not_stored_are_named_with_their_place(
    catalog: RecordingCatalog,
) -> None:
    with pytest.raises(
        InvalidInput, match=r"recordings\[0\] = 'a' is not a stored recording: there is"
    ):
        catalog.check(["a"])
    catalog.add(CLIP, "nod.csv")
    catalog.check(["nod"])
    for name in ("walk", "../nod", "nod.csv", "nod\n"):
        for ask in (catalog.check, catalog.runs_of):
            with pytest.raises(InvalidInput) as caught:
                ask(["nod", name])
            assert (caught.value.field, caught.value.choices) == ("recordings[1]", ("nod",))


@pytest.mark.parametrize(
    ("file_name", "name"),
    [
        ("Clip 3.bvh", "clip-3"),
        ("/tmp/0.csv", "0"),
        ("__a__b..c.mot", "a-b-c"),
        ("x" * 80 + ".bvh", "x" * 64),
        ("größe.bvh", "gr-e"),
    ],
)
def test_name_is_made_from_the_file_s(file_name: str, name: str) -> None:
    assert recording_catalog.recording_name(file_name) == name


def test_file_without_letters_needs_a_name(catalog: RecordingCatalog) -> None:
    with pytest.raises(InvalidInput, match="name = '' must be given: the file's name has none"):
        catalog.add(CLIP, "动作.csv")
    assert catalog.add(CLIP, "动作.csv", "gesture")[0].file_name == "动作.csv"


@pytest.mark.parametrize("name", ["", "-a", "A", "a b", "a/b", "a\n", "x" * 65, "."])
def test_name_that_cannot_be_one_is_refused(catalog: RecordingCatalog, name: str) -> None:
    with pytest.raises(InvalidInput, match="1 to 64 of the characters a-z 0-9 -"):
        catalog.add(CLIP, "nod.csv", name)


@pytest.mark.parametrize(
    ("file_name", "rule"),
    [
        ("", "must name a file"),
        ("/", "must name a file"),
        ("a\x00.csv", "characters that can be shown"),
        ("\udcff.csv", "characters that can be shown"),
        ("x" * 256, "at most 255 characters, not 256"),
    ],
)
def test_file_name_that_cannot_be_one_is_refused(
    catalog: RecordingCatalog, file_name: str, rule: str
) -> None:
    with pytest.raises(InvalidInput, match=rule):
        catalog.add(CLIP, file_name)


def test_bad_file_leaves_nothing_behind(catalog: RecordingCatalog) -> None:
    with pytest.raises(BadRecording):
        catalog.add(CLIP[:300], "nod.csv")
    assert catalog.names() == ()


@pytest.mark.parametrize(
    "tensors",
    [b"", b"\x80\x04K\x01.", b"\xff" * 8 + b"{}", b"\x02\x00\x00\x00\x00\x00\x00\x00{}"],
    ids=["empty", "pickle", "huge header", "no arrays"],
)
def test_stored_bytes_that_are_no_runs_are_named(
    store: Store, catalog: RecordingCatalog, tensors: bytes
) -> None:
    new = packed(read_motion(CLIP, "nod.csv"), "nod", "nod.csv", "a" * 64)
    put_recording(store, replace(new, tensors=tensors))
    with pytest.raises(InvalidInput, match="recording = 'nod' was stored by another version"):
        catalog.get("nod")


def test_stored_body_of_another_version_is_read_as_far_as_it_is_known(
    store: Store, catalog: RecordingCatalog
) -> None:
    found = read_motion(CLIP, "nod.csv")
    new = packed(found, "nod", "nod.csv", "a" * 64)
    size = {**asdict(found.size), "tail": 0.7, "trunk": 0.5}
    del size["forearm_l"]
    recorded = {**new.detail["recorded"], "size": size}
    put_recording(store, replace(new, detail={**new.detail, "recorded": recorded}))
    (run,) = catalog.get("nod")
    assert run.size == replace(found.size, trunk=0.5)


def test_stored_runs_that_do_not_add_up_are_named(
    store: Store, catalog: RecordingCatalog
) -> None:
    new = packed(read_motion(CLIP, "nod.csv"), "nod", "nod.csv", "a" * 64)
    recorded = {**new.detail["recorded"], "sources": ["a", "b"]}
    put_recording(store, replace(new, detail={**new.detail, "recorded": recorded}))
    with pytest.raises(InvalidInput, match="post it again"):
        catalog.get("nod")


if CLIPS:  # without clips there is no test to skip

    @pytest.mark.parametrize("path", CLIPS, ids=lambda path: f"{path.parent.name}/{path.name}")
    def test_recorded_clip_comes_back_as_it_was_imported(
        catalog: RecordingCatalog, path: Path
    ) -> None:
        catalog.add(path.read_bytes(), path.name)
        (name,) = catalog.names()
        assert same(catalog.get(name), read_motion(path.read_bytes(), path.name).runs)
