"""All protocols by name, as the command line and evaluation jobs know them."""

import time
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from app.errors import InvalidInput, NotFound
from app.policies.checkpoint import Checkpoint
from app.policies.evaluation import people, pick, safety, tracker
from app.sim.motions import Motion

Protocol = Callable[..., dict[str, Any]]

PROTOCOLS: Mapping[str, Protocol] = MappingProxyType(
    {
        "pick-single": pick.run_single,
        "pick-choice": pick.run_choice,
        "pick-tracker": tracker.run_tracker,
        "pick-people": people.run_people,
        "pick-courtesy": people.run_courtesy,
        "pick-mocap": people.run_mocap,
        "safety-ssm": safety.run_safety,
    }
)
"""Protocol by name; each takes a checkpoint, ``episodes`` and ``seed``."""
WITH_MOTIONS = frozenset({"pick-mocap"})
"""Protocols that take recorded motion."""
WITHOUT_CHECKPOINT = frozenset({"safety-ssm"})
"""Protocols in which no policy takes part."""
MAX_EPISODES = 100_000
"""Most episodes of one evaluation."""


def evaluate(
    name: str,
    checkpoint: Checkpoint | None,
    *,
    episodes: int | None = None,
    seed: int = 11,
    motions: Sequence[Motion] = (),
) -> dict[str, Any]:
    """Run a protocol and return its result, ready for JSON.

    Args:
        name: Name of the protocol.
        checkpoint: What is evaluated; None only where no policy takes part.
        episodes: Number of episodes; the protocol's own number by default.
        seed: Seed of the episodes.
        motions: Runs of recorded motion, for the protocols in WITH_MOTIONS.

    Raises:
        NotFound: No protocol has that name.
        InvalidInput: The number of episodes or the seed cannot be used, or there is no
            checkpoint.
    """
    if name not in PROTOCOLS:
        raise NotFound("protocol", name, tuple(PROTOCOLS))
    if episodes is not None and not 1 <= episodes <= MAX_EPISODES:
        raise InvalidInput("episodes", episodes, f"must lie in [1, {MAX_EPISODES}]")
    if not 0 <= seed < 2**31:
        raise InvalidInput("seed", seed, "must lie in [0, 2^31)")
    if checkpoint is None and name not in WITHOUT_CHECKPOINT:
        raise InvalidInput("checkpoint", None, f"must name a checkpoint for {name}")
    tested = {} if name in WITHOUT_CHECKPOINT else _identity(checkpoint)
    started = time.process_time()
    more = {"motions": motions} if name in WITH_MOTIONS else {}
    outcome = PROTOCOLS[name](checkpoint, episodes=episodes, seed=seed, **more)
    return {
        "protocol": name,
        **tested,
        "seed": seed,
        "episodes": outcome["results"][0]["n"],
        **outcome,
        "cpu_seconds": round(time.process_time() - started, 2),
    }


def _identity(checkpoint: Checkpoint | None) -> dict[str, str]:
    return {} if checkpoint is None else {"checkpoint": checkpoint.sha256}
