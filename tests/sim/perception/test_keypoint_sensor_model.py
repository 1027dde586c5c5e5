"""The model of a tracker: late, noisy, incomplete as asked for, and the same for a seed."""

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.perception.keypoint_sensor_model import (
    Frame,
    KeypointSensorModel,
    KeypointSensorSettings,
)
from app.sim.perception.person_estimator import PersonEstimator
from tests.sim.tracked_person import CELL, motion, seen
from tests.sim.tracker_errors import follow

EXACT = KeypointSensorSettings(noise=0.0, missing=0.0, latency_s=0.0)


def frames(
    settings: KeypointSensorSettings, seed: int = 4, end: float = 10.0
) -> tuple[Frame, ...]:
    tracker = KeypointSensorModel(settings, seed, CELL.body, CELL.floor_z)
    return tracker.frames(end, motion(1, 12.0))


def test_an_exact_tracker_says_what_is_there() -> None:
    found, truth = frames(EXACT), motion(1, 12.0)
    assert len(found) == 301
    for frame in found[::30]:
        np.testing.assert_allclose(frame.keypoints, seen(truth(frame.t)), atol=1e-12)


def test_frames_come_after_the_latency_each_once_whatever_the_worlds_step() -> None:
    settings = KeypointSensorSettings(latency_s=0.1)
    tracker = KeypointSensorModel(settings, 4, CELL.body, CELL.floor_z)
    got = []
    for t in np.arange(0, 201) * 0.05:
        new = tracker.frames(t, motion(1, 12.0))
        assert all(t - 0.05 - 1e-6 <= frame.t + 0.1 <= t + 1e-6 for frame in new)
        got.extend(new)
    whole = frames(settings)
    assert [frame.t for frame in got] == [frame.t for frame in whole]
    np.testing.assert_array_equal(got[77].keypoints, whole[77].keypoints)


def test_noise_and_loss_have_the_size_asked_for() -> None:
    truth, found = motion(1, 12.0), frames(KeypointSensorSettings(lost=0.25))
    assert abs(len(found) / 301 - 0.75) < 0.08
    errors = np.array([frame.keypoints - seen(truth(frame.t)) for frame in found])
    assert np.nanstd(errors) == pytest.approx(0.02, rel=0.05)
    assert np.isnan(errors).mean() == pytest.approx(0.2, abs=0.02)
    trust = np.array([frame.confidences for frame in found])
    np.testing.assert_array_equal(trust == 0.0, np.isnan(errors).any(axis=2))


def test_long_gaps_have_the_share_and_the_length_asked_for() -> None:
    found = frames(KeypointSensorSettings(missing=0.2, missing_s=0.3))
    missing = np.array([frame.confidences == 0.0 for frame in found])
    assert missing.mean() == pytest.approx(0.2, abs=0.05)
    starts = (missing[1:] & ~missing[:-1]).sum()
    assert missing.sum() / starts / 30.0 == pytest.approx(0.3, rel=0.25)


def test_same_seed_disturbs_alike_and_another_does_not() -> None:
    one, two, three = (frames(KeypointSensorSettings(), seed, 1.0) for seed in (4, 4, 5))
    for a, b in zip(one, two, strict=True):
        np.testing.assert_array_equal(a.keypoints, b.keypoints)
    assert not np.array_equal(one[3].keypoints, three[3].keypoints, equal_nan=True)


def test_what_was_seen_comes_back_as_the_person_who_was_there() -> None:
    tracker = KeypointSensorModel(EXACT, 4, CELL.body, CELL.floor_z)
    times, truth = np.arange(201) * 0.05, motion(1, 12.0)
    estimator = PersonEstimator(CELL.body)
    errors = []
    for t, estimate in zip(times, follow(truth, times, tracker, estimator), strict=True):
        assert estimate.person is not None and estimate.t == t and not estimate.stale
        errors.append(np.abs(estimate.person.q - truth(t)))
    assert np.median(errors) < 0.01


def test_a_tracker_that_delivers_nothing_leaves_the_person_unseen() -> None:
    tracker = KeypointSensorModel(KeypointSensorSettings(lost=1.0), 4, CELL.body, CELL.floor_z)
    estimator = PersonEstimator(CELL.body)
    for estimate in follow(motion(1, 12.0), [0.0, 0.5, 1.0], tracker, estimator):
        assert estimate.stale and estimate.flags == ("never-seen",)
        assert estimate.person is None and estimate.cylinder is None


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("rate_hz", 0.0),
        ("rate_hz", np.nan),
        ("latency_s", -0.1),
        ("noise", np.inf),
        ("missing", 1.0),
        ("lost", 1.1),
        ("sides_swapped", 2.0),
    ],
)
def test_settings_without_sense_are_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(InvalidInput) as caught:
        KeypointSensorSettings(**{name: value})
    assert caught.value.field == name
