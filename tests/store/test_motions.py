from dataclasses import replace

import pytest

from app.errors import Conflict, InvalidInput, NotFound
from app.store import motions
from app.store.engine import Store
from app.store.records import NewRecording

WAVE = NewRecording(
    name="wave",
    sha256="a" * 64,
    file_name="wave.bvh",
    n_runs=2,
    n_frames=250,
    duration=4.98,
    summary={"unit": "mm"},
    detail={"clean_runs": [{"first": 0}]},
    tensors=b"\x00\x01\xff",
)


def test_stored_motion_comes_back_unchanged(store: Store) -> None:
    assert motions.put_recording(store, WAVE)
    record, tensors = motions.read_runs(store, "wave")
    assert tensors == WAVE.tensors
    assert (record.sha256, record.file_name) == (WAVE.sha256, "wave.bvh")
    assert (record.n_runs, record.n_frames, record.duration) == (2, 250, 4.98)
    assert (record.summary, record.detail, record.size) == (WAVE.summary, WAVE.detail, 3)


def test_same_file_again_is_harmless_and_another_one_refused(store: Store) -> None:
    motions.put_recording(store, WAVE)
    assert not motions.put_recording(store, replace(WAVE, tensors=b"converted anew"))
    with pytest.raises(Conflict, match="'wave' from another file is stored: remove it"):
        motions.put_recording(store, replace(WAVE, sha256="b" * 64))
    assert motions.read_runs(store, "wave")[1] == WAVE.tensors


def test_same_file_may_have_two_names(store: Store) -> None:
    motions.put_recording(store, WAVE)
    assert motions.put_recording(store, replace(WAVE, name="other"))
    assert motions.recording_names(store) == ("other", "wave")


def test_what_is_stored_is_found_before_the_file_is_imported(store: Store) -> None:
    assert motions.find_same(store, "wave", WAVE.sha256) is None
    motions.put_recording(store, WAVE)
    assert motions.find_same(store, "wave", WAVE.sha256) == motions.read_runs(store, "wave")[0]
    with pytest.raises(Conflict, match="choose another name"):
        motions.find_same(store, "wave", "b" * 64)


def test_motions_are_listed_by_name_without_their_detail(store: Store) -> None:
    assert motions.list_recordings(store) == ()
    for name in ("b", "a", "c"):
        motions.put_recording(store, replace(WAVE, name=name))
    listed = motions.list_recordings(store)
    assert [record.name for record in listed] == ["a", "b", "c"]
    assert {record.detail for record in listed} == {None}


def test_motion_of_a_removed_one_s_name_has_another_number(store: Store) -> None:
    motions.put_recording(store, WAVE)
    first = motions.recording_number(store, "wave")
    motions.remove_recording(store, "wave")
    assert motions.put_recording(store, replace(WAVE, sha256="b" * 64))
    assert motions.recording_number(store, "wave") > first


def test_motion_that_nobody_stored_is_not_found(store: Store) -> None:
    for read in (motions.read_runs, motions.recording_number):
        with pytest.raises(NotFound):
            read(store, "wave")
    with pytest.raises(NotFound):
        motions.remove_recording(store, "wave")


def test_only_so_many_motions_are_kept(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motions, "MAX_RECORDINGS", 2)
    for name in ("a", "b"):
        motions.put_recording(store, replace(WAVE, name=name))
    assert not motions.put_recording(store, replace(WAVE, name="b"))
    with pytest.raises(Conflict, match="2 motions are stored, no more are kept"):
        motions.put_recording(store, replace(WAVE, name="c"))
    with pytest.raises(Conflict, match="2 motions are stored, no more are kept"):
        motions.find_same(store, "c", WAVE.sha256)


def test_only_so_many_bytes_are_kept(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motions, "MAX_TOTAL", 3)
    motions.put_recording(store, WAVE)
    with pytest.raises(Conflict, match="the stored motions take 3 bytes"):
        motions.put_recording(store, replace(WAVE, name="other"))


def test_motion_that_is_too_large_is_refused(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(motions, "MAX_TENSORS", 2)
    with pytest.raises(InvalidInput, match="exceed the limit of 2 bytes per motion"):
        motions.put_recording(store, WAVE)
