"""What a tracker of walking cylinders knows, against where they are."""

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.perception.cylinder_sensor_model import CylinderSensorModel, CylinderSensorSettings

DT = 0.02


def follow(
    settings: CylinderSensorSettings,
    n: int,
    seconds: float,
    predicted: bool = True,
    dt: float = DT,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Straight walks at 1 m/s; returns what is seen, how it changes and what is true."""
    rng, rows = np.random.default_rng(3), np.arange(n)
    start = rng.uniform(-1.0, 1.0, (n, 1, 3))
    course = rng.uniform(0.0, 2.0 * np.pi, n)
    velocity = np.stack([np.cos(course), np.sin(course), np.zeros(n)], axis=1)[:, None]
    tracker = CylinderSensorModel(settings, n, 1, 7)
    tracker.start(rows, start, velocity)
    seen, change, true = [tracker.seen(rows)[0]], [tracker.seen(rows)[1]], [start]
    for k in range(1, round(seconds / dt) + 1):
        true.append(start + k * dt * velocity)
        tracker.observe(rows, np.full(n, k * dt), true[-1])
        position, speed = tracker.seen(rows, predicted=predicted)
        seen.append(position)
        change.append(speed)
    return np.array(seen), np.array(change), np.array(true)


@pytest.mark.parametrize("latency", [0.0, 0.1, 0.25])
def test_a_straight_walk_is_known_exactly_however_late(latency: float) -> None:
    settings = CylinderSensorSettings(latency_s=latency, noise=0.0)
    seen, change, true = follow(settings, 5, 2.0)
    np.testing.assert_allclose(seen, true, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(change, axis=-1), 1.0, atol=1e-9)


@pytest.mark.parametrize("dt", [DT, 0.05, 0.2])
def test_the_newest_frame_is_as_old_as_latency_and_rate_say(dt: float) -> None:
    settings = CylinderSensorSettings(latency_s=0.1, noise=0.0)
    seen, _, true = follow(settings, 40, 4.0, predicted=False, dt=dt)
    behind = np.linalg.norm(seen - true, axis=-1)[1:]  # at 1 m/s, metres are seconds
    assert behind.min() >= 0.1 - 1e-9
    assert behind.max() <= 0.1 + 1.0 / 30.0 + 1e-9
    assert behind.max() - behind.min() > 0.02


def test_cameras_have_phases_of_their_own() -> None:
    settings = CylinderSensorSettings(latency_s=0.0, noise=0.0)
    seen, _, true = follow(settings, 40, 1.0, predicted=False)
    behind = np.linalg.norm(seen - true, axis=-1)[25, :, 0]
    assert len(np.unique(np.round(behind, 6))) > 30


def test_the_filter_lessens_noise_in_place_and_knows_the_speed() -> None:
    settings = CylinderSensorSettings(latency_s=0.0, noise=0.02)
    seen, change, true = follow(settings, 300, 2.0)
    assert 0.005 < (seen - true)[10:].std() < 0.02
    off = change[50:] - (true[1] - true[0]) / DT
    assert np.abs(off.mean()) < 0.01
    assert off.std() < 0.35


def test_a_turn_is_noticed_after_the_latency() -> None:
    settings = CylinderSensorSettings(latency_s=0.1, noise=0.0)
    tracker, rows = CylinderSensorModel(settings, 1, 1, 7), np.arange(1)
    there, walk = np.array([[[0.0, 1.0, 0.3]]]), np.array([[[1.0, 0.0, 0.0]]])
    tracker.start(rows, there, walk)
    speeds = []
    for k in range(1, 26):  # stands still from the start on
        tracker.observe(rows, np.full(1, k * DT), there)
        speeds.append(tracker.seen(rows)[1][0, 0, 0])
    assert speeds[3] == pytest.approx(1.0)
    assert abs(speeds[-1]) < 0.05


def test_other_cells_go_on_while_one_is_reset() -> None:
    settings = CylinderSensorSettings(latency_s=0.1, noise=0.0)
    tracker, rows = CylinderSensorModel(settings, 3, 2, 7), np.arange(3)
    there = np.random.default_rng(4).uniform(-1, 1, (3, 2, 3))
    tracker.start(rows, there, np.zeros_like(there))
    tracker.observe(rows, np.full(3, DT), there)
    before = tracker.seen(rows)[0]
    tracker.start(np.array([1]), there[1:2] + 5.0, np.zeros((1, 2, 3)))
    after = tracker.seen(rows)[0]
    np.testing.assert_array_equal(after[[0, 2]], before[[0, 2]])
    np.testing.assert_allclose(after[1], there[1] + 5.0)


def test_same_seed_gives_the_same_disturbances() -> None:
    settings = CylinderSensorSettings()
    one, other = (follow(settings, 4, 0.5)[0] for _ in range(2))
    np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(
    ("field", "value"),
    [("rate_hz", 0.0), ("rate_hz", 60.0), ("latency_s", -0.1), ("noise", float("nan"))],
)
def test_an_impossible_tracker_is_refused_by_its_field(field: str, value: float) -> None:
    with pytest.raises(InvalidInput) as caught:
        CylinderSensorSettings(**{field: value})
    assert caught.value.field == field
