"""The function behind what was seen of a walker, where it can be told, compiled.

Radius and speed of a walker are sums of three sines (``pedestrian.py``) of five constants. Who
remembers some moments knows them: the frequency is looked for on a grid, with the six factors
of sines and cosines by least squares; from the best ones Levenberg's method finds all five
constants together. Moments at a limit only say that the function is beyond it.

A fit counts where it meets all that is remembered to ``TRUSTED``: so of people who do not walk
like that, or seen through noise, nothing is said, and the networks of ``forecast.py`` go on.

Source: METHOD 2.1 for the function; Levenberg, *A method for the solution of certain non-linear
problems in least squares* (1944).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.geometry.capsules import copy_values
from app.sim.people.kernels.pedestrian import AMPLITUDES, N_PAST, PAST_S

N_SEEN = N_PAST + 1
"""Moments: now and what is remembered."""
MULTIPLES = (1.0, 3.0, 4.0)
"""Of the frequency, one for each sine."""
N_GRID = 20
"""Frequencies looked at."""
N_TRIED = 8
"""From how many of them Levenberg's method starts."""
MOST_STEPS = 60
"""Its steps."""
LEAST_FREE = 6
"""Moments not at a limit below which no function is looked for."""
TRUSTED = 5e-4
"""Largest root mean square error of a fit that counts [m or m/s]."""
AT_LIMIT = 1e-6
"""How near a value is that counts as at a limit [m or m/s]."""
RIDGE = 1e-5
"""Weight of small factors in the linear fits."""
GOOD = 1.7e-8
"""Sum of squared errors at which nothing better is looked for [m^2 or (m/s)^2]."""
NOT_FOUND = -1.0
"""In place of the amplitude: no function was found."""
WORST = 1e30
"""More than any such sum."""
STUCK = 1e-4
"""Share of the error that a step must take off, far from GOOD."""
FIRST_DAMPING, MOST_DAMPING, LEAST_DIAGONAL = 1e-3, 1e6, 1e-6
"""Of Levenberg's method."""
LEAST_HZ = 1e-4
"""Least frequency [Hz]."""
N_CONSTANTS = 5
"""Frequency, amplitude, three phases."""
FREE, BELOW, ABOVE = range(3)
"""Kinds of moments: the function was seen, or it was at a limit."""


class Limits(NamedTuple):
    """What is known of every walker of a kind."""

    low: float
    """Least value [m or m/s]; a function below is seen as ``low``, a speed as 0."""
    high: float
    """Greatest value."""
    f_max: float
    """Greatest frequency [Hz]."""


class Fit(NamedTuple):
    """Work space; made once."""

    t: Vec
    """Moments [s], shape (N_SEEN,)."""
    value: Vec
    """What was seen then, shape (N_SEEN,)."""
    kind: NDArray[np.int64]
    """FREE, BELOW or ABOVE, shape (N_SEEN,)."""
    constants: Vec
    """Frequency [Hz], amplitude, three phases [rad], shape (5,)."""
    trial: Vec
    """Others, shape (5,)."""
    starts: Vec
    """Error and constants of the best starts, shape (N_TRIED, 6)."""
    matrix: Vec
    """Normal equations, shape (6, 7)."""
    slope: Vec
    """Derivatives by the constants, shape (6,)."""


def new_fit() -> Fit:
    """Return work space."""
    return Fit(
        t=np.zeros(N_SEEN),
        value=np.zeros(N_SEEN),
        kind=np.zeros(N_SEEN, dtype=np.int64),
        constants=np.zeros(N_CONSTANTS),
        trial=np.zeros(N_CONSTANTS),
        starts=np.zeros((N_TRIED, N_CONSTANTS + 1)),
        matrix=np.zeros((6, 7)),
        slope=np.zeros(6),
    )


@kernel(error_model="numpy")
def value_at(constants: Vec, middle: float, t: float) -> float:
    """Return the function at a moment [s], before it is cut."""
    w, total = 2.0 * math.pi * constants[0] * t, 0.0
    for k in range(3):
        total += AMPLITUDES[k] * math.sin(MULTIPLES[k] * w + constants[2 + k])
    return float(middle + constants[1] * total)


@kernel(error_model="numpy")
def _solve(matrix: Vec, n: int) -> None:
    """Solve n equations of a positive definite matrix in place.

    Args:
        matrix: Coefficients, and in column n right sides, which become the solution.
        n: Unknowns.
    """
    for i in range(n):
        for r in range(i + 1, n):
            share = matrix[r, i] / matrix[i, i]
            for c in range(i, n + 1):
                matrix[r, c] -= share * matrix[i, c]
    for i in range(n - 1, -1, -1):
        for c in range(i + 1, n):
            matrix[i, n] -= matrix[i, c] * matrix[c, n]
        matrix[i, n] /= matrix[i, i]


@kernel(error_model="numpy")
def _off(kind: int, said: float, seen: float, low: float, high: float) -> float:
    """Return by how much the function contradicts what was seen."""
    if kind == FREE:
        return said - seen
    if kind == BELOW:
        return max(0.0, said - low)
    return min(0.0, said - high)


@kernel(error_model="numpy")
def _error(fit: Fit, constants: Vec, limits: Limits) -> float:
    """Return the sum of squared contradictions."""
    middle, total = 0.5 * (limits.low + limits.high), 0.0
    for m in range(N_SEEN):
        said = value_at(constants, middle, fit.t[m])
        off = _off(fit.kind[m], said, fit.value[m], limits.low, limits.high)
        total += off * off
    return total


@kernel(error_model="numpy")
def _linear(fit: Fit, limits: Limits, f: float) -> None:
    """Write constants for a frequency [Hz] into ``fit.trial``, from the moments at no limit."""
    a, middle = fit.matrix, 0.5 * (limits.low + limits.high)
    a[:] = 0.0
    for i in range(6):
        a[i, i] = RIDGE
    for m in range(N_SEEN):
        if fit.kind[m] != FREE:
            continue
        w = 2.0 * math.pi * f * fit.t[m]
        for k in range(3):
            fit.slope[2 * k] = math.sin(MULTIPLES[k] * w)
            fit.slope[2 * k + 1] = math.cos(MULTIPLES[k] * w)
        for i in range(6):
            for j in range(6):
                a[i, j] += fit.slope[i] * fit.slope[j]
            a[i, 6] += fit.slope[i] * (fit.value[m] - middle)
    _solve(a, 6)
    weight = total = 0.0
    for k in range(3):
        s, c = a[2 * k, 6], a[2 * k + 1, 6]
        total += AMPLITUDES[k] * math.hypot(s, c)
        weight += AMPLITUDES[k] * AMPLITUDES[k]
        fit.trial[2 + k] = math.atan2(c, s)
    fit.trial[0] = f
    fit.trial[1] = min(limits.high, max(limits.low, total / weight))


@kernel(error_model="numpy")
def _normal_equations(fit: Fit, limits: Limits, damping: float) -> None:
    """Write those of the step from ``fit.constants``, damped, into ``fit.matrix``."""
    a, x, middle = fit.matrix, fit.constants, 0.5 * (limits.low + limits.high)
    a[:] = 0.0
    for m in range(N_SEEN):
        t = fit.t[m]
        said = value_at(x, middle, t)
        off = _off(fit.kind[m], said, fit.value[m], limits.low, limits.high)
        if off == 0.0:
            continue
        fit.slope[0] = fit.slope[1] = 0.0
        for k in range(3):
            phase = 2.0 * math.pi * MULTIPLES[k] * x[0] * t + x[2 + k]
            turn = x[1] * AMPLITUDES[k] * math.cos(phase)
            fit.slope[0] += turn * 2.0 * math.pi * MULTIPLES[k] * t
            fit.slope[1] += AMPLITUDES[k] * math.sin(phase)
            fit.slope[2 + k] = turn
        for i in range(N_CONSTANTS):
            for j in range(N_CONSTANTS):
                a[i, j] += fit.slope[i] * fit.slope[j]
            a[i, N_CONSTANTS] -= fit.slope[i] * off
    for i in range(N_CONSTANTS):
        a[i, i] += damping * (a[i, i] + LEAST_DIAGONAL)


@kernel(error_model="numpy")
def _descend(fit: Fit, limits: Limits) -> float:
    """Improve ``fit.constants`` by Levenberg's method; return the error."""
    x, error, damping = fit.constants, _error(fit, fit.constants, limits), FIRST_DAMPING
    for _ in range(MOST_STEPS):
        if error < GOOD or damping > MOST_DAMPING:
            break
        _normal_equations(fit, limits, damping)
        _solve(fit.matrix, N_CONSTANTS)
        for i in range(N_CONSTANTS):
            fit.trial[i] = x[i] + fit.matrix[i, N_CONSTANTS]
        fit.trial[0] = min(limits.f_max, max(LEAST_HZ, fit.trial[0]))
        fit.trial[1] = min(limits.high, max(limits.low, fit.trial[1]))
        tried = _error(fit, fit.trial, limits)
        if tried < error:
            stuck = error - tried < STUCK * tried and tried > 100.0 * GOOD
            copy_values(fit.trial, x)
            error, damping = tried, 0.2 * damping
            if stuck:
                break
        else:
            damping *= 6.0
    return error


@kernel(error_model="numpy")
def _remember(fit: Fit, now: float, age: float, past: Vec, limits: Limits, speed: bool) -> int:
    """Fill moments, values and kinds; return how many are at no limit."""
    n_free = 0
    for m in range(N_SEEN):
        fit.t[m] = 0.0 if m == 0 else -(age + PAST_S * (m - 1))
        value = now if m == 0 else past[m - 1]
        low = value < limits.low if speed else value <= limits.low + AT_LIMIT
        fit.value[m], fit.kind[m] = value, FREE
        if value >= limits.high - AT_LIMIT:
            fit.kind[m] = ABOVE
        elif low:
            fit.kind[m] = BELOW
        else:
            n_free += 1
    return n_free


@kernel(error_model="numpy")
def _find_starts(fit: Fit, limits: Limits) -> None:
    """Fill ``fit.starts`` with the best linear fits of all frequencies, the best first."""
    fit.starts[:, 0] = WORST
    for g in range(N_GRID):
        _linear(fit, limits, (g + 0.5) / N_GRID * limits.f_max)
        error, n = _error(fit, fit.trial, limits), N_TRIED
        while n > 0 and error < fit.starts[n - 1, 0]:
            n -= 1
        for m in range(N_TRIED - 1, n, -1):
            copy_values(fit.starts[m - 1], fit.starts[m])
        if n < N_TRIED:
            fit.starts[n, 0] = error
            copy_values(fit.trial, fit.starts[n, 1:])


@kernel(error_model="numpy")
def find_function(
    fit: Fit,
    now: float,
    age: float,
    past: Vec,
    limits: Limits,
    speed: bool,
    since: float,
    found: Vec,
) -> bool:
    """Find the constants behind what is remembered.

    Args:
        fit: Work space.
        now: Value now [m or m/s].
        age: How long ago the newest moment remembered was [s].
        past: Values remembered, the newest first, shape (N_PAST,).
        limits: What is known of all.
        speed: Whether it is a speed, of which 0 is seen below the limit.
        since: Time since the last call for this walker [s].
        found: What was found then, kept where it still holds, shape (5,); zeros at first.
            Filled; the amplitude is NOT_FOUND where there is nothing to be found, and 0 where
            too little is known to look.

    Returns:
        Whether they meet all that is remembered.
    """
    n_free = _remember(fit, now, age, past, limits, speed)
    enough = max(1, n_free) * TRUSTED * TRUSTED
    if found[1] > 0.0:
        for k in range(3):
            found[2 + k] += 2.0 * math.pi * MULTIPLES[k] * found[0] * since
        if _error(fit, found, limits) < enough:
            return True
        found[1] = 0.0
    if n_free < LEAST_FREE or limits.f_max <= 0.0:
        return False
    if found[1] < 0.0 and age > since - 1e-9:
        return False  # Nothing more is remembered since it was not found.
    _find_starts(fit, limits)
    least = WORST
    for n in range(N_TRIED):
        copy_values(fit.starts[n, 1:], fit.constants)
        error = _descend(fit, limits)
        if error < least:
            least = error
            copy_values(fit.constants, found)
        if least < GOOD:
            break
    if least >= enough:
        found[1] = NOT_FOUND
    return least < enough
