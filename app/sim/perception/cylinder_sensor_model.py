"""Sensor model of a tracker of pedestrians, for a batch of environments.

A camera measures x, y and radius of every person at its own rate with noise, and delivers each
measurement after its latency, stamped with its sampling time. A constant-velocity Kalman filter
with steady-state gains predicts the present position and velocity over the latency.

Each environment has a camera with a random phase relative to the control periods.

Source: docs/method.md 2.8 (30 Hz). Latency, noise and filter are ours.
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from app.errors import InvalidInput, digits
from app.sim.core.arrays import Vec

LOOKED_S = 0.5
"""Observation time before an episode starts [s], with people at their initial velocity."""
TURN = 4.0
"""Standard deviation of the acceleration in the filter [m/s^2]: reversal of 1 m/s in 0.5 s."""
EXACT = 1e-4
"""Smallest noise assumed by the filter [m]."""
MAX_RATE_HZ = 50.0
"""Highest frame rate [Hz]."""
N_STATE = 3
"""Number of measured values per person: x, y, radius [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CylinderSensorSettings:
    """Rate, latency and noise of a tracker.

    Raises:
        InvalidInput: A value is not finite or out of range.
    """

    rate_hz: float = 30.0
    """Frames per second [Hz], at most MAX_RATE_HZ."""
    latency_s: float = 0.1
    """Time from sampling a frame to its delivery [s]."""
    noise: float = 0.02
    """Standard deviation of x, y and radius in each frame [m]."""

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if not np.isfinite(value) or value < 0.0:
                raise InvalidInput(item.name, value, "must be finite and not negative")
        if not 0.0 < self.rate_hz <= MAX_RATE_HZ:
            raise InvalidInput(
                "rate_hz", self.rate_hz, f"must lie in (0, {digits(MAX_RATE_HZ)}] Hz"
            )

    def gains(self) -> tuple[float, float]:
        """Return the steady gains of position and speed [1, 1/s] of the Kalman filter.

        Closed form (Kalata's tracking index): with ``L = a T^2 / noise``,
        ``r = (4 + L - sqrt(8 L + L^2)) / 4``, ``alpha = 1 - r^2``,
        ``beta = 2 (2 - alpha) - 4 sqrt(1 - alpha)``.
        """
        period = 1.0 / self.rate_hz
        index = TURN * period**2 / max(self.noise, EXACT)
        r = 0.25 * (4.0 + index - np.sqrt(8.0 * index + index**2))
        alpha = 1.0 - r * r
        beta = 2.0 * (2.0 - alpha) - 4.0 * np.sqrt(1.0 - alpha)
        return float(alpha), float(beta / period)


class CylinderSensorModel:
    """Cameras and filters of ``n`` environments with ``n_people`` pedestrians each."""

    def __init__(
        self, settings: CylinderSensorSettings, n: int, n_people: int, seed: int
    ) -> None:
        self._settings, self._rng = settings, np.random.default_rng(seed)
        self._gains = settings.gains()
        self._period = 1.0 / settings.rate_hz
        self._shape = (n_people, N_STATE)
        self._now = np.zeros(n)
        self._true = np.zeros((n, *self._shape))
        self._next = np.zeros(n)
        width = 2 + int(np.ceil(settings.latency_s * settings.rate_hz))
        self._queue = np.zeros((n, width, *self._shape))
        self._stamps = np.full((n, width), np.inf)
        self._time = np.zeros(n)
        self._state = np.zeros((2, n, *self._shape))

    def start(self, rows: NDArray[np.int64], people: Vec, velocity: Vec) -> None:
        """Start an episode in some environments, with observations before it.

        Args:
            rows: Environments, shape (k,).
            people: Initial x, y and radius of all people [m], shape (k, n_people, 3).
            velocity: Initial rates of change [m/s], same shape.
        """
        if not len(rows):
            return
        since = -LOOKED_S - self._settings.latency_s
        first = since + self._period * self._rng.random(len(rows))
        self._now[rows], self._next[rows] = since, first
        self._true[rows] = people + since * velocity
        self._stamps[rows] = np.inf
        self._time[rows] = since
        self._state[0, rows], self._state[1, rows] = self._true[rows], velocity
        for t in np.linspace(since, 0.0, int(np.ceil(-since / self._period)) + 1)[1:]:
            self.observe(rows, np.full(len(rows), t), people + t * velocity)

    def observe(self, rows: NDArray[np.int64], t: Vec, people: Vec) -> None:
        """Advance the time of some environments.

        Args:
            rows: Environments, shape (k,).
            t: Present time in the episode [s], shape (k,).
            people: Present x, y and radius of all people [m], shape (k, n_people, 3);
                interpolated linearly since the last call.
        """
        since, before = self._now[rows], self._true[rows]
        span = np.maximum(t - since, 1e-12)
        while True:
            noise = self._settings.noise * self._rng.standard_normal(before.shape)
            part = (self._next[rows] - since) / span
            measured = before + part[:, None, None] * (people - before) + noise
            taken = self._next[rows] <= t + 1e-9
            self._push(rows[taken], self._next[rows[taken]], measured[taken])
            self._next[rows[taken]] += self._period
            self._deliver(rows, t)
            if not (self._next[rows] <= t + 1e-9).any():
                break
        self._now[rows], self._true[rows] = t, people

    def _push(self, rows: NDArray[np.int64], stamps: Vec, measured: Vec) -> None:
        place = np.argmax(np.isinf(self._stamps[rows]), axis=1)
        self._stamps[rows, place], self._queue[rows, place] = stamps, measured

    def _deliver(self, rows: NDArray[np.int64], t: Vec) -> None:
        """Update the filters with the delivered frames, oldest first."""
        while True:
            oldest = self._stamps[rows].argmin(axis=1)
            stamps = self._stamps[rows, oldest]
            ready = stamps + self._settings.latency_s <= t + 1e-9
            if not ready.any():
                return
            which, place = rows[ready], oldest[ready]
            self._update(which, stamps[ready], self._queue[which, place])
            self._stamps[which, place] = np.inf

    def _update(self, rows: NDArray[np.int64], stamps: Vec, measured: Vec) -> None:
        alpha, beta = self._gains
        step = (stamps - self._time[rows])[:, None, None]
        position, speed = self._state[0, rows], self._state[1, rows]
        predicted = position + step * speed
        off = measured - predicted
        self._state[0, rows] = predicted + alpha * off
        self._state[1, rows] = speed + beta * off
        self._time[rows] = stamps

    def seen(self, rows: NDArray[np.int64], *, predicted: bool = True) -> tuple[Vec, Vec]:
        """Return the estimated state of all people.

        Args:
            rows: Environments, shape (k,).
            predicted: Predict from the newest frame to the present time.

        Returns:
            x, y, radius [m] and their rates of change [m/s], each of shape (k, n_people, 3).
        """
        position, speed = self._state[0, rows], self._state[1, rows]
        late = (self._now[rows] - self._time[rows])[:, None, None] if predicted else 0.0
        return position + late * speed, speed.copy()
