"""Job specs: what may be posted, checked in full before anything is queued.

    {"kind": "train", "preset": "pick-td3", "seed": 1, "overrides": {"total_steps": 20000}}
    {"kind": "evaluate", "protocol": "pick-single", "episodes": 1000, "seed": 11,
     "checkpoint": "pick"}

An unknown field is an error. The body is stored unchanged with the job.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

MAX_SEED = 2**32 - 1
"""Greatest seed; every random stream accepts it."""

MAX_EPISODES = 1_000_000
"""Longest evaluation."""

KINDS = ("train", "evaluate")
"""What a job may do."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainSpec:
    """Train a policy by a preset."""

    preset: str
    """Name of the preset."""
    seed: int = 0
    """Seed of every random stream."""
    overrides: Mapping[str, Any]
    """Changes to the preset's fields."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EvaluateSpec:
    """Measure a checkpoint by a protocol."""

    protocol: str
    """Name of the protocol."""
    checkpoint: str
    """SHA-256 or alias of the checkpoint."""
    episodes: int | None = None
    """Number of episodes; None for the protocol's own."""
    seed: int = 0
    """Seed of every random stream."""
