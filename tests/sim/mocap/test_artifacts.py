import numpy as np
import pytest

from app.sim.core.arrays import Vec
from app.sim.human.anthropometry import BodySize
from app.sim.mocap.artifacts import (
    MARGIN,
    MAX_SPEED,
    MIN_RUN,
    Artifact,
    clean_runs,
    find_artifacts,
    merged,
)
from app.sim.mocap.joint_centres import ELBOW_L, WRIST_L, WRIST_R, model_points
from tests.sim.recorded_person import working

DT = 0.01


def points_of_person(n: int = 600) -> tuple[Vec, Vec]:
    q = working(n, DT)
    return DT * np.arange(n), model_points(q, np.full(n, 0.9), BodySize())


def test_person_at_work_has_no_artifact_and_is_one_run() -> None:
    times, points = points_of_person()
    assert find_artifacts(times, points) == ()
    assert clean_runs(times, ()) == ((0, 599),)


def test_marker_that_leaps_for_some_frames_is_named_and_cut_out() -> None:
    times, points = points_of_person()
    points[250:256, WRIST_R] += [0.0, 0.8, 0.0]
    (artifact,) = find_artifacts(times, points)
    assert (artifact.first, artifact.last) == (249, 256)
    assert artifact.parts == ("wrist_r",)
    assert "jumps" in artifact.reason
    (first, second) = clean_runs(times, [artifact])
    assert first == (0, 243) and second == (262, 599)
    assert times[artifact.first] - times[first[1]] > MARGIN


def test_parts_stand_in_the_order_of_their_speed() -> None:
    times, points = points_of_person()
    points[300, WRIST_L] += 0.09
    points[300, ELBOW_L] += 0.04
    (artifact,) = find_artifacts(times, points)
    assert artifact.parts == ("wrist_l", "elbow_l")
    assert artifact.speed == pytest.approx(0.09 * np.sqrt(3.0) / DT, rel=0.1)


def test_speed_just_below_the_limit_is_clean() -> None:
    times = DT * np.arange(300)
    points = np.zeros((300, 8, 3))
    points[:, WRIST_R, 0] = 0.99 * MAX_SPEED * times
    assert find_artifacts(times, points) == ()
    points[:, WRIST_R, 0] = 1.01 * MAX_SPEED * times
    (artifact,) = find_artifacts(times, points)
    assert "faster than 3 m/s" in artifact.reason
    assert clean_runs(times, [artifact]) == ()


def test_hole_in_the_times_parts_two_runs() -> None:
    times, points = points_of_person()
    times = times + np.where(np.arange(600) >= 300, 0.5, 0.0)
    (artifact,) = find_artifacts(times, points)
    assert (artifact.first, artifact.last, artifact.parts) == (299, 300, ("time",))
    assert "0.51 s without a frame" in artifact.reason
    assert [b - a for a, b in clean_runs(times, [artifact])] == [293, 293]


def test_missing_values_are_listed_among_artifacts_in_frames_of_the_file() -> None:
    times, points = points_of_person(200)
    frames = np.delete(np.arange(200), range(60, 90))
    missing = Artifact(first=60, last=89, parts=("elbow_r",), speed=0.0, reason="no value")
    points[150:152, WRIST_R] += 0.8
    found = find_artifacts(times[frames], points[frames])
    assert [one.parts[0] for one in found] == ["time", "wrist_r"]
    spans = merged(found, [missing], frames)
    assert [(one.first, one.last) for one in spans] == [(60, 89), (149, 152)]


def test_hole_without_missing_values_is_reported_as_before() -> None:
    times, points = points_of_person(200)
    times = times + np.where(np.arange(200) >= 100, 0.5, 0.0)
    found = find_artifacts(times, points)
    assert merged(found, (), np.arange(200)) == found


def test_runs_shorter_than_a_second_are_dropped() -> None:
    times, points = points_of_person()
    points[[200, 280], WRIST_R] += 0.5
    runs = clean_runs(times, find_artifacts(times, points))
    assert runs == ((0, 193), (287, 599))


class CountedTimes(np.ndarray):
    """Times that count the numbers of their arithmetic."""

    work = 0

    def __array_ufunc__(
        self, ufunc: np.ufunc, method: str, *inputs: object, **options: object
    ) -> object:
        plain = [np.asarray(one) for one in inputs]
        CountedTimes.work += max(one.size for one in plain)
        return getattr(ufunc, method)(*plain, **options)


def many_artifacts(n: int) -> tuple[Vec, list[Artifact]]:
    """Return ``n`` times at about 50 Hz, with about one artefact per 100 of them."""
    rng = np.random.default_rng(7)
    firsts = np.flatnonzero(rng.random(n - 50) < 0.01)
    lasts = firsts + rng.integers(1, 50, len(firsts))
    found = [
        Artifact(first=int(a), last=int(b), parts=("wrist_r",), speed=9.0, reason="")
        for a, b in zip(firsts, lasts, strict=True)
    ]
    return np.cumsum(rng.uniform(0.01, 0.03, n)), found


def test_runs_between_many_artifacts_are_farther_from_each_than_the_margin() -> None:
    times, artifacts = many_artifacts(20_000)
    bad = np.zeros(len(times), dtype=bool)
    for one in artifacts:
        bad |= (times > times[one.first] - MARGIN) & (times < times[one.last] + MARGIN)
    runs = clean_runs(times, artifacts)
    good = np.flatnonzero(~bad)
    groups = np.split(good, np.flatnonzero(np.diff(good) > 1) + 1)
    long = [(one[0], one[-1]) for one in groups if times[one[-1]] - times[one[0]] >= MIN_RUN]
    assert len(long) > 20 and runs == tuple(long)


def test_work_for_runs_grows_with_the_frames_and_artifacts_not_their_product() -> None:
    times, artifacts = many_artifacts(20_000)
    CountedTimes.work = 0
    clean_runs(times.view(CountedTimes), artifacts)
    assert 0 < CountedTimes.work <= 4 * (len(times) + len(artifacts))


def test_holes_are_replaced_by_the_missing_values_inside_them() -> None:
    def span(first: int, last: int, part: str) -> Artifact:
        return Artifact(first=first, last=last, parts=(part,), speed=0.0, reason="")

    missing = [span(40, 41, "elbow_r"), span(11, 12, "elbow_r")]
    holes = [span(10, 13, "time"), span(12, 40, "time"), span(39, 42, "time")]
    left = merged(holes, missing, np.arange(50))
    assert [(one.first, one.parts[0]) for one in left] == [
        (11, "elbow_r"),
        (12, "time"),
        (40, "elbow_r"),
    ]
