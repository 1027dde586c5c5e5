"""Compiled segments against the movement primitives they come from, in plain numpy."""

import numpy as np
import pytest

from app.sim.core.kernels import rng as random
from app.sim.primitives.kernels.primitives import (
    N_BASIS,
    PrimitiveLibrary,
    Segments,
    condition,
    draw_segments,
    follow,
    phase_profile,
)
from app.sim.primitives.kernels.script import MAX_MOVES, Moves
from app.sim.primitives.promp import (
    ProMP,
    basis,
    fit,
    gain,
    observe,
    positions,
    usual_width,
)

ENDS = np.array([0.0, 1.0])
FREE = np.full(18, 1e3)


@pytest.fixture(scope="module")
def promp() -> ProMP:
    rng, z = np.random.default_rng(5), np.linspace(0.0, 1.0, 60)[:, None]
    a, b, curvature = rng.normal(0.0, 0.3, (3, 8, 18))
    motions = [a[i] + (b[i] - a[i]) * z**2 + curvature[i] * np.sin(np.pi * z) for i in range(8)]
    return fit(motions, np.full(8, 1.5))


def rows_of_ends(promp: ProMP) -> np.ndarray:
    phi = basis(ENDS, N_BASIS, promp.width)
    return np.concatenate([np.kron(np.eye(18), row) for row in phi])


def test_positions_and_speeds_are_those_of_the_primitive(promp: ProMP) -> None:
    q, qd = np.empty(18), np.empty(18)
    assert (promp.n_basis, promp.width) == (N_BASIS, usual_width(N_BASIS))
    for phase in np.linspace(0.0, 1.0, 41):
        follow(promp.mean, phase, 0.7, -FREE, FREE, q, qd)
        before, at, after = positions(promp, promp.mean, phase + np.array([-1e-6, 0.0, 1e-6]))
        np.testing.assert_allclose(q, at, atol=1e-12)
        np.testing.assert_allclose(qd, 0.7 * (after - before) / 2e-6, atol=1e-6)


def test_a_joint_held_at_its_limit_has_no_speed(promp: ProMP) -> None:
    q, qd = np.empty(18), np.empty(18)
    low, high = np.full(18, -0.01), np.full(18, 0.01)
    follow(promp.mean, 0.4, 1.0, low, high, q, qd)
    assert ((q >= low) & (q <= high)).all()
    assert (qd[(q == low) | (q == high)] == 0.0).all() and (qd != 0.0).any()


def test_a_segment_meets_both_postures_and_is_the_conditioned_primitive(promp: ProMP) -> None:
    rng, out, away = np.random.default_rng(6), np.empty((18, N_BASIS)), np.empty(36)
    q, qd = np.empty(18), np.empty(18)
    rows = rows_of_ends(promp)
    k = gain(promp, rows, np.zeros((36, 36)))
    for _ in range(10):
        ends = rng.normal(0.0, 0.4, (2, 18))
        condition(promp.mean, k, ends[0], ends[1], away, out)
        expected = observe(promp, rows, ends.ravel(), np.zeros((36, 36))).mean
        np.testing.assert_allclose(out, expected, atol=1e-9)
        for phase, posture in zip(ENDS, ends, strict=True):
            follow(out, phase, 1.0, -FREE, FREE, q, qd)
            np.testing.assert_allclose(q, posture, atol=1e-6)


@pytest.mark.parametrize("stop_at", [0.0, 0.3, 0.8])
def test_a_segment_goes_from_rest_to_rest_and_nowhere_faster_for_a_pause(
    stop_at: float,
) -> None:
    duration, stop_s = 1.6, 0.5
    whole = duration + (stop_s if stop_at else 0.0)
    times = np.linspace(-0.1, whole + 0.1, 4001)
    phase, rate = np.array([phase_profile(t, duration, stop_at, stop_s) for t in times]).T
    assert phase[0] == 0.0 and phase[-1] == 1.0 and (np.diff(phase) >= 0.0).all()
    assert rate[0] == rate[-1] == 0.0 and rate.max() <= 1.875 / duration + 1e-9
    np.testing.assert_allclose(np.gradient(phase, times)[1:-1], rate[1:-1], atol=6e-3)
    standing = times[(phase > 1e-9) & (phase < 1.0 - 1e-9) & (rate < 1e-9)]
    assert np.ptp(standing) == pytest.approx(stop_s, abs=0.02) if stop_at else True


def drawn(seed: int, varied: bool) -> dict[str, np.ndarray]:
    """A script of a cell with three cubes and two docks."""
    n, segments = 5, np.full((6, 6, 2, 3), -1, dtype=np.int64)
    kinds = ["cube"] * 3 + ["dock"] * 2 + ["home"]
    number = 0
    for a in range(n + 1):
        for b in range(n + 1):
            for hand in range(2):
                if kinds[a] != kinds[b]:
                    segments[a, b, hand] = number, 2 * number, 2
                    number += 1
    primitive_library = PrimitiveLibrary(
        np.zeros((2 * number, 18, N_BASIS)),
        np.zeros((number, 216, 36)),
        segments,
        np.tile([np.log(1.2), 0.3], (number, 1)),
        varied,
    )
    of_station = np.array([[[10 * p, 4], [10 * p + 5, 4]] for p in range(n + 1)])
    of_station[n, :] = 10 * n, 4
    rng = np.zeros(1, dtype=np.uint64)
    random.start_stream(seed, 0, 0, rng)
    moves = Moves(
        np.zeros(MAX_MOVES), np.zeros(MAX_MOVES), np.zeros(MAX_MOVES + 1, dtype=np.int64)
    )
    rows = Segments(
        np.zeros(MAX_MOVES, dtype=np.int64),
        np.zeros(MAX_MOVES, dtype=np.int64),
        np.zeros((MAX_MOVES, 2)),
    )
    n_moves = draw_segments(rng, primitive_library, of_station, 3, -1, moves, rows)
    return {**moves._asdict(), **rows._asdict(), "n": np.array(n_moves), "segments": segments}


def test_scripts_are_chains_of_segments_that_exist_and_end_at_home() -> None:
    for seed in range(200):
        script = drawn(seed, varied=True)
        n = int(script["n"])
        places = script["chosen"][: n + 1] // 10
        hands = (script["chosen"][: n + 1] % 10 >= 5).astype(int)
        assert places[0] == places[n] == 5
        for k in range(n):
            hand = hands[k + 1] if places[k + 1] != 5 else hands[k]
            row = script["segments"][places[k], places[k + 1], hand]
            assert row[0] == script["primitive"][k] >= 0
            assert script["sample"][k] - row[1] in (0, 1)
        ends = script["start"][:n] + script["duration"][:n] + script["stop"][:n, 1]
        assert (script["start"][1:n] >= ends[:-1]).all()


def test_a_hand_is_kept_until_the_worker_is_home_again() -> None:
    for seed in range(100):
        script = drawn(seed, varied=True)
        chosen = script["chosen"][: int(script["n"]) + 1]
        places, left = chosen // 10, chosen % 10 >= 5
        away = (places[1:] != 5) & (places[:-1] != 5)
        assert (left[1:] == left[:-1])[away].all()


def test_without_variation_durations_are_the_primitives_own_and_without_pauses() -> None:
    script = drawn(3, varied=False)
    n = int(script["n"])
    np.testing.assert_allclose(script["duration"][:n], 1.2)
    assert (script["stop"][:n] == 0.0).all()
