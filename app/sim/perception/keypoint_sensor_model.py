"""Sensor model of a key-point tracker.

A camera samples the true motion at its own rate as BODY_25 key-points
(:func:`~app.sim.perception.keypoints.keypoints_of`), adds noise, drops key-points and whole
frames, and delivers each frame after its latency, stamped with its sampling time (one common
clock). Equal seeds give equal disturbances.

Source: docs/method.md 2.8 (30 Hz). Noise and loss rates are ours.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np

from app.errors import InvalidInput
from app.sim.core.arrays import Vec
from app.sim.perception.keypoints import GROUPS, N_KEYPOINTS, keypoints_of, swap_sides

Motion = Callable[[float], Vec]
"""True joint positions [m, rad], shape (18,), at a time [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class KeypointSensorSettings:
    """Rate, latency, noise and losses of a key-point tracker."""

    rate_hz: float = 30.0
    """Frames per second [Hz]."""
    latency_s: float = 0.1
    """Time from sampling a frame to its delivery [s]."""
    noise: float = 0.02
    """Standard deviation of each coordinate [m]."""
    missing: float = 0.2
    """Share of key-points that are missing, in [0, 1)."""
    missing_s: float = 0.0
    """Mean time for which a key-point stays missing [s]; below one frame: frame by frame."""
    lost: float = 0.0
    """Share of lost frames, in [0, 1]."""
    sides_swapped: float = 0.0
    """Share of frames in which left and right are exchanged in arms, legs and face."""

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if not np.isfinite(value) or value < 0.0:
                raise InvalidInput(item.name, value, "must be finite and not negative")
        if self.rate_hz == 0.0:
            raise InvalidInput("rate_hz", self.rate_hz, "must be greater than 0 Hz")
        if self.missing >= 1.0:
            raise InvalidInput("missing", self.missing, "must lie in [0, 1)")
        for name in ("lost", "sides_swapped"):
            if getattr(self, name) > 1.0:
                raise InvalidInput(name, getattr(self, name), "must lie in [0, 1]")


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """One frame of key-points of one person."""

    t: float
    """Sampling time [s]."""
    delivered: float
    """Delivery time [s]."""
    keypoints: Vec
    """Key-points [m], shape (25, 3), NaN where missing."""
    confidences: Vec
    """1, or 0 where missing, shape (25,)."""


class KeypointSensorModel:
    """Simulated tracker of one person.

    Args:
        settings: Rate, latency, noise and losses.
        seed: Seed of noise and losses.
        size: The person's size [m], shape (12,) (``Cell.body``).
        floor_z: Height of the floor in the cell [m].
        start: Time of the first frame [s].
    """

    def __init__(
        self,
        settings: KeypointSensorSettings,
        seed: int | Sequence[int],
        size: Vec,
        floor_z: float,
        start: float = 0.0,
    ) -> None:
        self.settings = settings
        self._rng = np.random.default_rng(seed)
        self._size, self._floor_z, self._start = size, floor_z, start
        self._n_taken = 0
        self._missing = self._rng.random(N_KEYPOINTS) < settings.missing
        self._waiting: list[Frame] = []

    def frames(self, t: float, motion: Motion) -> tuple[Frame, ...]:
        """Return the frames delivered since the last call, up to ``t``.

        Args:
            t: Present time [s].
            motion: The true motion, evaluated at the sampling times since the last call.
        """
        period = 1.0 / self.settings.rate_hz
        while self._start + self._n_taken * period <= t + 1e-9:
            taken = self._start + self._n_taken * period
            self._n_taken += 1
            frame = self._take(taken, motion(taken))
            if frame is not None:
                self._waiting.append(frame)
        ready = tuple(frame for frame in self._waiting if frame.delivered <= t + 1e-9)
        self._waiting = self._waiting[len(ready) :]
        return ready

    def _take(self, t: float, q: Vec) -> Frame | None:
        """Return one frame, or None if it is lost; the number of random draws is fixed."""
        settings, rng = self.settings, self._rng
        points = keypoints_of(q, self._size, self._floor_z)
        points += settings.noise * rng.standard_normal(points.shape)
        draw, lost, swapped = rng.random(N_KEYPOINTS), rng.random(), rng.random()
        self._missing = draw < np.where(self._missing, *self._loss_rates())
        points[self._missing] = np.nan
        if swapped < settings.sides_swapped:
            for group in GROUPS:
                points = swap_sides(points, group)
        if lost < settings.lost:
            return None
        trust = np.asarray(np.isfinite(points).all(axis=1), dtype=np.float64)
        return Frame(t=t, delivered=t + settings.latency_s, keypoints=points, confidences=trust)

    def _loss_rates(self) -> tuple[float, float]:
        """Return the probabilities of a missing key-point after a missing and a seen one.

        Two-state Markov chain with stationary share ``missing`` and mean duration
        ``missing_s``: transition out 1 / n, transition in missing / (1 - missing) / n.
        """
        share = self.settings.missing
        n = self.settings.missing_s * self.settings.rate_hz
        if n <= 1.0 / (1.0 - share):
            return share, share
        return 1.0 - 1.0 / n, share / (1.0 - share) / n
