"""Limits hold whatever is asked for: invariants over random and adversarial actions."""

import numpy as np
import pytest

from app.sim.kernels import polynomial

TOLERANCE = 1e-9
N_ROBOTS, N_STEPS = 200, 500
PUSHES = ("random", "up", "down", "nearest limit", "away then back", "flip each step")


class Limits:
    """One joint's limits, repeated for many joints."""

    def __init__(self, span: float, speed: float, acc: float, dt: float) -> None:
        n = 6 * N_ROBOTS
        self.low, self.high = np.full(n, -span), np.full(n, 0.7 * span)
        self.speed, self.acc, self.dt = np.full(n, speed), np.full(n, acc), dt


CASES = {
    "pick-and-place": Limits(6.2, 0.5, 3.0, 0.05),
    "narrow": Limits(0.15, 0.5, 3.0, 0.05),
    "fast": Limits(0.5, 3.2, 5.0, 0.02),
    "weak brakes": Limits(1.0, 2.0, 0.4, 0.1),
    "strong brakes": Limits(0.3, 0.4, 60.0, 0.05),
}


def viable_states(limits: Limits, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Random states from which every joint can still stop, many of them just so."""
    q = rng.uniform(limits.low, limits.high)
    edge = rng.random(q.shape) < 0.5
    q[edge] = np.where(rng.random(edge.sum()) < 0.5, limits.low[edge], limits.high[edge])
    q[edge] *= 1 - rng.uniform(0, 0.05, edge.sum())
    acc_dt = limits.acc * limits.dt

    def stoppable(room: np.ndarray) -> np.ndarray:
        return -0.5 * acc_dt + np.sqrt(0.25 * acc_dt**2 + 2 * limits.acc * room)

    most = np.minimum(limits.speed, stoppable(limits.high - q))
    least = np.maximum(-limits.speed, -stoppable(q - limits.low))
    share = rng.choice([0.0, 1.0, 0.5, rng.random()], q.shape)
    return q, least + share * (most - least)


def push(kind: str, q: np.ndarray, limits: Limits, step: int, rng: np.random.Generator):
    """What an actor asks for, as a share of the speed limit."""
    if kind == "up":
        return np.ones_like(q)
    if kind == "down":
        return -np.ones_like(q)
    if kind == "nearest limit":
        return np.where(q > 0.5 * (limits.low + limits.high), 1.0, -1.0)
    if kind == "away then back":
        return np.where((np.arange(len(q)) * 7 + step) % 40 < 20, 1.0, -1.0)
    if kind == "flip each step":
        return np.full_like(q, 1.0 if step % 2 else -1.0)
    return rng.uniform(-1, 1, q.shape)


def excess(value: np.ndarray, low: np.ndarray, high: np.ndarray) -> float:
    return float(np.maximum(value - high, low - value).max())


def turning_points(q: np.ndarray, qd: np.ndarray, c: np.ndarray, dt: float) -> np.ndarray:
    """Joint positions at the extreme inside the period; at its start where there is none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        x = -qd / (2 * c)
    inside = (x > 0) & (x < dt)
    return np.where(inside, q - qd**2 / (4 * np.where(inside, c, 1.0)), q)


@pytest.mark.parametrize("kind", PUSHES)
@pytest.mark.parametrize("name", CASES)
def test_no_limit_is_ever_exceeded_from_viable_states(name: str, kind: str) -> None:
    limits, rng = CASES[name], np.random.default_rng(51)
    q, qd = viable_states(limits, rng)
    c, q1, qd1 = np.empty_like(q), np.empty_like(q), np.empty_like(q)
    worst = -np.inf
    for step in range(N_STEPS):
        target = push(kind, q, limits, step, rng) * limits.speed
        polynomial.advance(
            q, qd, target, limits.low, limits.high, limits.speed, limits.acc, limits.dt,
            c, q1, qd1,
        )  # fmt: skip
        worst = max(
            worst,
            excess(q1, limits.low, limits.high),
            excess(turning_points(q, qd, c, limits.dt), limits.low, limits.high),
            excess(qd1, -limits.speed, limits.speed),
            excess(2 * c, -limits.acc, limits.acc),
        )
        q, q1, qd, qd1 = q1, q, qd1, qd
    assert N_ROBOTS * N_STEPS == 100_000
    assert worst <= TOLERANCE


@pytest.mark.parametrize("name", CASES)
def test_interval_is_never_empty_and_both_its_ends_keep_it_so(name: str) -> None:
    limits, rng = CASES[name], np.random.default_rng(52)
    q, qd = viable_states(limits, rng)
    ends = (limits.low[0], limits.high[0], limits.speed[0], limits.acc[0], limits.dt)
    for _ in range(60):
        interval = np.array(
            [
                polynomial.coefficient_interval(*state, *ends)
                for state in zip(q, qd, strict=True)
            ]
        )
        assert (interval[:, 0] <= interval[:, 1]).all()
        c = np.where(rng.random(len(q)) < 0.5, interval[:, 0], interval[:, 1])
        q, qd = q + qd * limits.dt + c * limits.dt**2, qd + 2 * c * limits.dt


def test_wanted_speed_is_met_exactly_where_it_is_admissible() -> None:
    c = polynomial.coefficient_for_speed(0.0, 0.1, 0.2, -1.0, 1.0, 0.5, 3.0, 0.05)
    assert 0.1 + 2 * c * 0.05 == pytest.approx(0.2, abs=1e-15)


def test_joint_beyond_its_limit_brakes_as_hard_as_it_may() -> None:
    c = polynomial.coefficient_for_speed(1.2, 0.5, 0.5, -1.0, 1.0, 0.5, 3.0, 0.05)
    assert c == -1.5
    c = polynomial.coefficient_for_speed(1.2, 0.03, 0.5, -1.0, 1.0, 0.5, 3.0, 0.05)
    assert 0.03 + 2 * c * 0.05 == pytest.approx(0.0, abs=1e-15)
