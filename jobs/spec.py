"""Job specs: what may be posted, checked in full before anything is queued.

    {"kind": "train", "preset": "pick-td3", "seed": 1,
     "overrides": {"learning": {"total_steps": 20480}}}
    {"kind": "evaluate", "protocol": "pick-single", "episodes": 1000, "seed": 11,
     "checkpoint": "pick"}
    {"kind": "evaluate", "protocol": "pick-mocap", "motions": ["wave", "walk"]}

An unknown field is an error. Motions are names of stored ones, never paths. The body is stored
unchanged with the job.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from app.errors import InvalidInput
from app.policies.configs import presets
from app.policies.evaluation.registry import (
    PROTOCOLS,
    check_motions,
    default_checkpoint,
    most_episodes,
)
from app.store.records import NewJob

MAX_SEED = 2**31 - 1
"""Greatest seed; every random stream accepts it."""

MAX_RECORDINGS = 32
"""Most stored motions of one evaluation."""

_FIELDS = {
    "train": ("kind", "preset", "seed", "overrides"),
    "evaluate": ("kind", "protocol", "episodes", "seed", "checkpoint", "motions"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainSpec:
    """Train a policy by a preset."""

    preset: str
    """Name of the preset."""
    seed: int
    """Seed of every random stream."""
    overrides: Mapping[str, Any]
    """Changes to the preset's fields."""
    total_steps: int
    """Environment steps it will take."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EvaluateSpec:
    """Measure a checkpoint by a protocol."""

    protocol: str
    """Name of the protocol."""
    checkpoint: str
    """SHA-256 or alias of the checkpoint."""
    episodes: int | None
    """Number of episodes; None for the protocol's own."""
    seed: int
    """Seed of every random stream."""
    motions: tuple[str, ...] = ()
    """Names of stored motions, for the protocols that take some."""


def parse_spec(body: Mapping[str, Any]) -> TrainSpec | EvaluateSpec:
    """Check a posted body.

    Args:
        body: The JSON object.

    Raises:
        InvalidInput: A field is missing, unknown or breaks a rule.
        NotFound: There is no such preset.
    """
    kind = body.get("kind")
    if not isinstance(kind, str) or kind not in _FIELDS:
        raise InvalidInput("kind", kind, "must be a kind of job", tuple(_FIELDS))
    for name, value in body.items():
        if name not in _FIELDS[kind]:
            rule = f"is no field of a job of kind {kind}"
            raise InvalidInput(name, value, rule, _FIELDS[kind])
    return _parse_train(body) if kind == "train" else _parse_evaluate(body)


def new_job(body: Mapping[str, Any]) -> NewJob:
    """Check a posted body and make of it what the store queues.

    Raises:
        InvalidInput: A field is missing, unknown or breaks a rule.
        NotFound: There is no such preset.
    """
    spec = parse_spec(body)
    if isinstance(spec, EvaluateSpec):
        return NewJob(kind="evaluate", spec=body, seed=spec.seed)
    return NewJob(
        kind="train",
        spec=body,
        preset=spec.preset,
        seed=spec.seed,
        overrides=spec.overrides,
        total_steps=spec.total_steps,
    )


def _parse_train(body: Mapping[str, Any]) -> TrainSpec:
    overrides = body.get("overrides", {})
    if not isinstance(overrides, Mapping):
        raise InvalidInput("overrides", overrides, "must be an object of groups of fields")
    preset = _text(body, "preset", tuple(presets.PRESETS))
    resolved = presets.resolve(preset, overrides)
    return TrainSpec(
        preset=preset,
        seed=_seed(body),
        overrides=overrides,
        total_steps=resolved.learning.total_steps,
    )


def _parse_evaluate(body: Mapping[str, Any]) -> EvaluateSpec:
    protocol = _text(body, "protocol", tuple(PROTOCOLS))
    if protocol not in PROTOCOLS:
        raise InvalidInput("protocol", protocol, "must name a protocol", tuple(PROTOCOLS))
    episodes = body.get("episodes")
    if episodes is not None:
        _check_integer("episodes", episodes, 1, most_episodes(protocol))
    return EvaluateSpec(
        protocol=protocol,
        checkpoint=_text({"checkpoint": default_checkpoint(protocol), **body}, "checkpoint"),
        episodes=episodes,
        seed=_seed(body),
        motions=_motions(body, protocol),
    )


def _motions(body: Mapping[str, Any], protocol: str) -> tuple[str, ...]:
    """Return the names of the motions; whether they are stored is for others to say."""
    names = body.get("motions", ())
    if not isinstance(names, list | tuple):
        raise InvalidInput("motions", names, "must be a list of names of stored motions")
    if len(names) > MAX_RECORDINGS:
        raise InvalidInput("motions", len(names), f"must be at most {MAX_RECORDINGS} names")
    for place, name in enumerate(names):
        if not isinstance(name, str) or not name:
            raise InvalidInput(f"motions[{place}]", name, "must be the name of a stored motion")
        if name in names[:place]:
            raise InvalidInput(f"motions[{place}]", name, "must be named once")
    check_motions(protocol, names)
    return tuple(names)


def _text(body: Mapping[str, Any], name: str, choices: tuple[str, ...] = ()) -> str:
    value = body.get(name)
    if not isinstance(value, str) or not value:
        raise InvalidInput(name, value, "must be a name", choices)
    return value


def _seed(body: Mapping[str, Any]) -> int:
    return _check_integer("seed", body.get("seed", 0), 0, MAX_SEED)


def _check_integer(name: str, value: Any, low: int, high: int) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        raise InvalidInput(name, value, f"must be an integer in [{low}, {high}]")
    return value
