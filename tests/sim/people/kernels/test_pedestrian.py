"""The walking cylinder's functions, and that a walker is the same alone and among others."""

import numpy as np
import pytest

from app.sim.core.kernels.rng import split_stream, start_stream, uniform
from app.sim.people.kernels.pedestrian import (
    AGE,
    COS_1,
    FREQUENCY,
    GAIT,
    GROWTH,
    MIDDLE,
    N_PAST,
    N_STATE,
    PAST_RADIUS,
    PAST_SPEED,
    RADIUS,
    SIN_1,
    SPEED,
    TARGET_X,
    TARGET_Y,
    VX,
    VY,
    WALKING,
    PedestrianRules,
    PedestrianState,
    R,
    X,
    Y,
    advance_pedestrian,
    start_pedestrian,
    wave,
)
from app.sim.people.pedestrian import PedestrianSettings, pedestrian_rules, pedestrian_state


def started(
    rules: PedestrianRules, n_envs: int, seed: int, envs: range | None = None
) -> PedestrianState:
    """Walkers of ``n_envs`` environments, numbered as in ``envs``, in their first episode."""
    state = pedestrian_state(n_envs, len(rules.rows))
    stream = np.zeros(1, dtype=np.uint64)
    for e, number in enumerate(envs or range(n_envs)):
        start_stream(seed, number, 0, stream)
        for p in range(len(rules.rows)):
            start_pedestrian(rules, state, e, p, stream)
    return state


def printed(state: PedestrianState, e: int, first: int, t: float) -> float:
    """Eq. (4.1), (4.2) as printed, with amplitude and phases read back from the constants."""
    constants = state.rows[e, 0, first:]
    w = constants[FREQUENCY]
    sin, cos = constants[SIN_1 : SIN_1 + 6 : 2], constants[COS_1 : COS_1 + 6 : 2]
    p1, p2, p3 = np.arctan2(cos, sin)
    f_r = np.hypot(sin[0], cos[0]) / 0.5
    return float(
        constants[MIDDLE]
        + 0.5 * f_r * np.sin(2 * np.pi * w * t + p1)
        + 0.3 * f_r * np.sin(6 * np.pi * w * t + p2)
        + 0.2 * f_r * np.sin(8 * np.pi * w * t + p3)
    )


@pytest.mark.parametrize("first", [SPEED, RADIUS])
def test_functions_are_the_printed_ones(first: int) -> None:
    state = started(pedestrian_rules([PedestrianSettings()]), 200, seed=1)
    for e, t in enumerate(np.random.default_rng(2).uniform(0.0, 25.0, 200)):
        assert wave(state.rows, e, 0, first, t) == pytest.approx(printed(state, e, first, t))


def test_constants_fill_their_ranges() -> None:
    state = started(pedestrian_rules([PedestrianSettings()]), 4000, seed=3)
    for first, low, high, f_max in ((SPEED, 0.3, 1.0, 1.0), (RADIUS, 0.2, 0.5, 0.5)):
        constants = state.rows[:, 0, first:]
        amplitude = np.hypot(constants[:, SIN_1], constants[:, COS_1]) / 0.5
        for values, least, greatest in (
            (amplitude, low, high),
            (constants[:, FREQUENCY], 0.0, f_max),
        ):
            span = greatest - least
            assert least <= values.min() < least + 0.01 * span
            assert greatest - 0.01 * span < values.max() <= greatest
            assert values.mean() == pytest.approx(least + 0.5 * span, abs=0.02 * span)


def test_radius_and_its_change_belong_together() -> None:
    rules = pedestrian_rules([PedestrianSettings()])
    state = started(rules, 50, seed=4)
    for e in range(50):
        for _ in range(100):
            before = state.rows[e, 0, R]
            advance_pedestrian(rules, state, e, 0, 0.02)
            grown = before + 0.02 * state.rows[e, 0, GROWTH]
            assert state.rows[e, 0, R] == pytest.approx(grown, abs=1e-15)


def test_batch_and_single_environments_give_the_same_bits() -> None:
    rules = pedestrian_rules([PedestrianSettings(), PedestrianSettings(kind="constant")])
    batch = started(rules, 16, seed=5)
    for _ in range(300):
        for e in range(16):
            for p in (1, 0):
                advance_pedestrian(rules, batch, e, p, 0.02)
    for e in range(16):
        single = started(rules, 1, seed=5, envs=range(e, e + 1))
        for p in range(2):
            for _ in range(300):
                advance_pedestrian(rules, single, 0, p, 0.02)
        assert single.rows[0].tobytes() == batch.rows[e].tobytes()


def test_two_walkers_of_an_environment_differ() -> None:
    state = started(pedestrian_rules([PedestrianSettings()] * 4), 1, seed=6)
    assert len({row.tobytes() for row in state.rows[0]}) == 4


def test_row_is_written_whole_by_a_start() -> None:
    rules = pedestrian_rules([PedestrianSettings(p_stay=1.0, kind="constant")])
    clean, used = started(rules, 1, seed=7), started(rules, 1, seed=8)
    for _ in range(2000):
        advance_pedestrian(rules, used, 0, 0, 0.02)
    stream = np.zeros(1, dtype=np.uint64)
    start_stream(7, 0, 0, stream)
    start_pedestrian(rules, used, 0, 0, stream)
    assert used.rows.shape == (1, 1, N_STATE)
    assert used.rows.tobytes() == clean.rows.tobytes()


def test_radius_and_speed_of_the_last_second_and_a_half_are_remembered() -> None:
    rules = pedestrian_rules([PedestrianSettings(p_still=0.0, p_stay=0.0)])
    state = started(rules, 8, seed=12)
    for e in range(8):
        row = state.rows[e, 0]
        assert row[PAST_RADIUS] == row[R] and len(np.unique(row[PAST_RADIUS:PAST_SPEED])) > 1
        seen = []
        for _ in range(90):
            seen.append([row[R], np.hypot(row[VX], row[VY])])
            advance_pedestrian(rules, state, e, 0, 0.02)
        assert row[AGE] == 0.0
        seen.append([row[R], np.hypot(row[VX], row[VY])])
        kept = np.stack([row[PAST_RADIUS:PAST_SPEED], row[PAST_SPEED:]], axis=1)
        np.testing.assert_allclose(kept, np.array(seen)[::-5][:N_PAST], atol=1e-12)
        advance_pedestrian(rules, state, e, 0, 0.02)
        assert row[AGE] == pytest.approx(0.02)
        np.testing.assert_array_equal(row[PAST_RADIUS:PAST_SPEED], kept[:, 0])


def test_the_past_before_a_start_goes_on_into_it() -> None:
    rules = pedestrian_rules([PedestrianSettings(p_still=0.0, p_stay=0.0)])
    state = started(rules, 40, seed=13)
    for e in range(40):
        row = state.rows[e, 0]
        before = row[PAST_RADIUS:PAST_SPEED].copy()
        for _ in range(5 * N_PAST):
            advance_pedestrian(rules, state, e, 0, 0.02)
        whole = np.concatenate([row[PAST_RADIUS:PAST_SPEED], before])
        assert np.abs(np.diff(whole)).max() < 0.1 * 2.1  # the radius changes by 2.1 m/s at most


def test_walker_that_would_pass_its_target_lands_on_it() -> None:
    settings = PedestrianSettings(
        kind="fixed-speed", fixed_speed=1.5, p_still=0.0, p_stay=1.0, tolerance=0.0
    )
    rules = pedestrian_rules([settings])
    state = started(rules, 20, seed=9)
    for e in range(20):
        row = state.rows[e, 0]
        target = row[[TARGET_X, TARGET_Y]]
        while row[GAIT] == WALKING:
            advance_pedestrian(rules, state, e, 0, 0.5)
        np.testing.assert_array_equal(row[[X, Y]], target)
        np.testing.assert_array_equal(row[[VX, VY]], 0.0)


def test_branches_of_a_stream_are_independent() -> None:
    n = 4000
    draws = np.empty((n, 2))
    stream, child = np.zeros(1, dtype=np.uint64), np.zeros(1, dtype=np.uint64)
    start_stream(1, 2, 3, stream)
    for k in range(n):
        for branch in range(2):
            split_stream(stream, branch, child)
            draws[k, branch] = uniform(child)
    assert abs(np.corrcoef(draws.T)[0, 1]) < 0.05
    np.testing.assert_allclose(draws.mean(axis=0), 0.5, atol=0.02)
    assert len(np.unique(draws)) == 2 * n
