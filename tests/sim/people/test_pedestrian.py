"""Walks of the cylinder of docs/method.md 2.1: bounds, turns, rests, variants, coverage."""

import dataclasses

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.people.kernels.pedestrian import STAYING, STILL, WALKING
from app.sim.people.pedestrian import PedestrianSettings
from tools.docs.world.walks import Walk, walk

DEFAULT = PedestrianSettings()
RESTLESS = PedestrianSettings(p_still=0.0, p_stay=0.0)


def walks(settings: PedestrianSettings, n: int, seconds: float = 10.0) -> list[Walk]:
    return [walk(settings, 1, seconds, episode=episode) for episode in range(n)]


def speeds(one: Walk) -> np.ndarray:
    return np.hypot(*one.velocity.T)


def test_speed_and_radius_keep_their_bounds() -> None:
    for one in walks(DEFAULT, 200):
        v = speeds(one)
        assert np.all((v == 0.0) | ((v > 0.3 - 1e-12) & (v < 1.0 + 1e-12)))
        assert one.radius.min() >= 0.2 and one.radius.max() <= 0.5


def test_every_bound_is_met() -> None:
    many = walks(RESTLESS, 100)
    v = np.concatenate([speeds(one) for one in many])
    r = np.concatenate([one.radius for one in many])
    for share in (v == 0.0, v > 1.0 - 1e-9, r == 0.2, r == 0.5, (v > 0.3) & (v < 0.99)):
        assert 0.03 < share.mean() < 0.9


def test_walker_never_leaves_its_area() -> None:
    settings = dataclasses.replace(RESTLESS, tolerance=0.0)
    for one in walks(settings, 100):
        assert np.all(one.position >= [-2.0 - 1e-12, 0.5 - 1e-12])
        assert np.all(one.position <= [1.0 + 1e-12, 2.0 + 1e-12])


def test_velocity_leads_to_the_next_position() -> None:
    for one in walks(RESTLESS, 50):
        path = np.diff(one.position, axis=0)
        np.testing.assert_allclose(path, 0.02 * one.velocity[:-1], atol=1e-12)


def test_path_leads_straight_to_the_target() -> None:
    for one in walks(RESTLESS, 50):
        to_target, v = one.target - one.position, speeds(one)
        moving = (v > 0.0) & (np.hypot(*to_target.T) > 0.1)
        (x, y), (vx, vy) = to_target[moving].T, one.velocity[moving].T
        np.testing.assert_allclose(x * vy - y * vx, 0.0, atol=1e-9)
        assert np.all(x * vx + y * vy > 0.0)


def test_walker_turns_within_the_tolerance_and_not_before() -> None:
    turns = 0
    for one in walks(RESTLESS, 100):
        turned = np.flatnonzero(np.any(np.diff(one.target, axis=0) != 0.0, axis=1))
        left = np.linalg.norm(one.target[turned] - one.position[turned + 1], axis=1)
        assert np.all(left <= 0.1 + 1e-9)
        # A period earlier it was farther away, but for targets that near from the start.
        before = np.linalg.norm(one.target[turned] - one.position[turned], axis=1)
        fresh = np.isin(turned - 1, turned) | (turned == 0)
        assert np.all((before > 0.1 - 1e-9) | fresh)
        turns += len(turned)
    assert turns > 300


def test_five_percent_stand_still_for_the_whole_episode() -> None:
    gaits = np.array([walk(DEFAULT, 2, 0.0, episode=k).gait[0] for k in range(8000)])
    assert np.mean(gaits == STILL) == pytest.approx(0.05, abs=0.01)
    for episode in np.flatnonzero(gaits == STILL)[:20]:
        one = walk(DEFAULT, 2, 5.0, episode=int(episode))
        assert np.all(one.position == one.position[0]) and np.all(one.velocity == 0.0)
        assert np.ptp(one.radius) > 0.0


def test_one_in_ten_stays_at_a_target_it_reached_for_good() -> None:
    settings = dataclasses.replace(DEFAULT, p_still=0.0)
    reached = stayed = 0
    for one in walks(settings, 400, seconds=15.0):
        turns = np.any(np.diff(one.target, axis=0) != 0.0, axis=1).sum()
        stays = one.gait[-1] == STAYING
        reached, stayed = reached + turns + stays, stayed + stays
        if stays:
            first = int(np.argmax(one.gait == STAYING))
            assert np.all(one.gait[first:] == STAYING)
            assert np.all(one.position[first:] == one.position[first])
            assert np.linalg.norm(one.target[first] - one.position[first]) <= 0.1 + 1e-9
    assert stayed / reached == pytest.approx(0.1, abs=0.025)


def test_constant_walker_keeps_one_speed_and_radius_per_episode() -> None:
    settings = dataclasses.replace(RESTLESS, kind="constant")
    many = walks(settings, 300, seconds=2.0)
    for one in many:
        assert np.ptp(speeds(one)) < 1e-12 and np.ptp(one.radius) == 0.0
    v, r = np.array([(speeds(one)[0], one.radius[0]) for one in many]).T
    assert 0.3 <= v.min() < 0.32 and 0.98 < v.max() <= 1.0
    assert 0.2 <= r.min() < 0.21 and 0.49 < r.max() <= 0.5


@pytest.mark.parametrize("speed", [0.25, 0.5, 1.0, 1.3])
def test_fixed_speed_passes_by_both_limits_of_the_speed(speed: float) -> None:
    settings = dataclasses.replace(RESTLESS, kind="fixed-speed", fixed_speed=speed)
    for one in walks(settings, 20):
        np.testing.assert_allclose(speeds(one), speed, rtol=1e-12)
        assert np.ptp(one.radius) > 0.0
        assert np.all(one.gait == WALKING)


def test_authors_targets_are_apart_and_a_radius_inside_the_area() -> None:
    settings = PedestrianSettings(p_still=0.0, p_stay=0.0, apart=0.5, inside=1.0)
    for one in walks(settings, 40, 20.0):
        new = np.flatnonzero(np.any(np.diff(one.target, axis=0) != 0.0, axis=1)) + 1
        for k in (0, *new):
            assert np.linalg.norm(one.target[k] - one.position[k]) >= 0.5
            # The radius of the period before is the one the target was drawn with.
            r = one.radius[k if k == 0 else k - 1]
            assert -2.0 + r <= one.target[k, 0] <= 1.0 - r
            assert 0.5 + r <= one.target[k, 1] <= 2.0 - r


def test_area_too_small_for_the_margin_leaves_its_middle() -> None:
    narrow = {"x_min": 0.0, "x_max": 0.4, "r_min": 0.3, "r_max": 0.5, "p_still": 0.0}
    one = walk(PedestrianSettings(**narrow, inside=1.0, apart=5.0), 1, 5.0)
    np.testing.assert_allclose(one.target[:, 0], 0.2)


def test_hurried_walker_is_never_slower_than_v_min_in_the_first_period() -> None:
    def first(hurried: bool) -> np.ndarray:
        settings = PedestrianSettings(p_still=0.0, hurried=hurried)
        return np.array([speeds(walk(settings, 5, 0.02, episode=k))[0] for k in range(300)])

    as_drawn, quick = first(False), first(True)
    stood = as_drawn == 0.0
    assert stood.any()
    np.testing.assert_allclose(quick[stood], 0.3)
    np.testing.assert_array_equal(quick[~stood], as_drawn[~stood])


def test_walker_goes_on_after_it_stayed_with_the_given_chance_per_period() -> None:
    settings = PedestrianSettings(p_still=0.0, p_stay=1.0, p_go_on=0.01)
    stays, leaves = 0, 0
    for one in walks(settings, 60, 40.0):
        staying = one.gait == STAYING
        stays += int(staying[:-1].sum())
        leaves += int((staying[:-1] & (one.gait[1:] == WALKING)).sum())
    assert leaves / stays == pytest.approx(0.01, abs=0.002)
    for_good = PedestrianSettings(p_still=0.0, p_stay=1.0)
    for one in walks(for_good, 20, 20.0):
        assert not np.any((one.gait[:-1] == STAYING) & (one.gait[1:] == WALKING))


def test_same_key_gives_the_same_bits_and_another_one_does_not() -> None:
    def key(seed: int, env: int, episode: int) -> bytes:
        return walk(DEFAULT, seed, 5.0, env=env, episode=episode).position.tobytes()

    assert key(1, 2, 3) == key(1, 2, 3)
    assert len({key(1, 2, 3), key(2, 2, 3), key(1, 3, 3), key(1, 2, 4)}) == 4


def test_longer_walk_starts_like_the_shorter_one() -> None:
    short, long = walk(RESTLESS, 3, 5.0), walk(RESTLESS, 3, 25.0)
    assert len(short.time) == 251 and len(long.time) == 1251
    np.testing.assert_array_equal(short.position, long.position[:251])


def test_walkers_cover_the_whole_area() -> None:
    cells = np.zeros((30, 15), dtype=bool)
    x, y = np.linspace(-1.95, 0.95, 30), np.linspace(0.55, 1.95, 15)
    for one in walks(RESTLESS, 60):
        for position, r in zip(one.position[::10], one.radius[::10], strict=True):
            dx, dy = x - position[0], y - position[1]
            cells |= dx[:, None] ** 2 + dy[None, :] ** 2 <= r * r
    assert cells.mean() > 0.99


def test_starts_are_uniform_in_the_area() -> None:
    starts = np.array([walk(DEFAULT, 5, 0.0, episode=k).position[0] for k in range(4000)])
    counts, _, _ = np.histogram2d(*starts.T, bins=(6, 3), range=((-2, 1), (0.5, 2)))
    assert counts.sum() == 4000
    np.testing.assert_allclose(counts / 4000, 1 / 18, atol=0.015)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("kind", "runner"),
        ("v_min", 1.5),
        ("r_max", 0.1),
        ("r_min", 0.0),
        ("x_max", -3.0),
        ("p_stay", 1.1),
        ("p_go_on", 1.1),
        ("apart", -0.1),
        ("p_still", -0.1),
        ("tolerance", float("nan")),
        ("fixed_speed", float("inf")),
    ],
)
def test_wrong_setting_is_refused_with_its_rule(field: str, value: object) -> None:
    with pytest.raises(InvalidInput, match="must "):
        PedestrianSettings(**{field: value})


@pytest.mark.parametrize(("seconds", "dt"), [(1.0, 0.0), (1.0, float("nan")), (-1.0, 0.02)])
def test_walk_of_no_period_is_refused(seconds: float, dt: float) -> None:
    with pytest.raises(InvalidInput):
        walk(DEFAULT, 1, seconds, dt)
