from dataclasses import replace

import pytest

from app.errors import Conflict, InvalidInput, NotFound
from app.store import recordings
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


def test_stored_recording_comes_back_unchanged(store: Store) -> None:
    assert recordings.put_recording(store, WAVE)
    record, tensors = recordings.read_runs(store, "wave")
    assert tensors == WAVE.tensors
    assert (record.sha256, record.file_name) == (WAVE.sha256, "wave.bvh")
    assert (record.n_runs, record.n_frames, record.duration) == (2, 250, 4.98)
    assert (record.summary, record.detail, record.size) == (WAVE.summary, WAVE.detail, 3)


def test_same_file_again_is_harmless_and_another_one_refused(store: Store) -> None:
    recordings.put_recording(store, WAVE)
    assert not recordings.put_recording(store, replace(WAVE, tensors=b"converted again"))
    with pytest.raises(Conflict, match="'wave' from another file is stored: remove it"):
        recordings.put_recording(store, replace(WAVE, sha256="b" * 64))
    assert recordings.read_runs(store, "wave")[1] == WAVE.tensors


def test_same_file_may_have_two_names(store: Store) -> None:
    recordings.put_recording(store, WAVE)
    assert recordings.put_recording(store, replace(WAVE, name="other"))
    assert recordings.recording_names(store) == ("other", "wave")


def test_what_is_stored_is_found_before_the_file_is_imported(store: Store) -> None:
    assert not recordings.is_stored(store, "wave", WAVE.sha256)
    recordings.put_recording(store, WAVE)
    assert recordings.is_stored(store, "wave", WAVE.sha256)
    with pytest.raises(Conflict, match="choose another name"):
        recordings.is_stored(store, "wave", "b" * 64)


def test_recordings_are_listed_by_name_without_their_detail(store: Store) -> None:
    assert recordings.list_recordings(store) == ()
    for name in ("b", "a", "c"):
        recordings.put_recording(store, replace(WAVE, name=name))
    listed = recordings.list_recordings(store)
    assert [record.name for record in listed] == ["a", "b", "c"]
    assert {record.detail for record in listed} == {None}


def test_recording_of_a_removed_one_s_name_has_another_number(store: Store) -> None:
    recordings.put_recording(store, WAVE)
    first = recordings.recording_number(store, "wave")
    recordings.remove_recording(store, "wave")
    assert recordings.put_recording(store, replace(WAVE, sha256="b" * 64))
    assert recordings.recording_number(store, "wave") > first


def test_unknown_recording_is_not_found(store: Store) -> None:
    for read in (recordings.read_runs, recordings.recording_number):
        with pytest.raises(NotFound):
            read(store, "wave")
    with pytest.raises(NotFound):
        recordings.remove_recording(store, "wave")


def test_only_so_many_recordings_are_kept(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recordings, "MAX_RECORDINGS", 2)
    for name in ("a", "b"):
        recordings.put_recording(store, replace(WAVE, name=name))
    assert not recordings.put_recording(store, replace(WAVE, name="b"))
    with pytest.raises(Conflict, match="2 recordings are stored, the limit"):
        recordings.put_recording(store, replace(WAVE, name="c"))
    with pytest.raises(Conflict, match="2 recordings are stored, the limit"):
        recordings.is_stored(store, "c", WAVE.sha256)


def test_only_so_many_bytes_are_kept(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recordings, "MAX_TOTAL", 3)
    recordings.put_recording(store, WAVE)
    with pytest.raises(Conflict, match="the stored recordings take 3 of at most 3 bytes"):
        recordings.put_recording(store, replace(WAVE, name="other"))


def test_recording_that_is_too_large_is_refused(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recordings, "MAX_TENSORS", 2)
    with pytest.raises(InvalidInput, match="exceed the limit of 2 bytes per recording"):
        recordings.put_recording(store, WAVE)
