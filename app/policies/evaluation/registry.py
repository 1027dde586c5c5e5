"""All protocols by name, as the command line and evaluation jobs know them."""

import time
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from app.errors import InvalidInput, NotFound
from app.policies.checkpoints.checkpoint import CHOOSING, REACHING, SORTING, Checkpoint, task_of
from app.policies.evaluation.pick import people, tracker
from app.policies.evaluation.pick import tasks as pick
from app.policies.evaluation.reach import (
    oracle as reach_ceiling,
)
from app.policies.evaluation.reach import (
    people as reach_people,
)
from app.policies.evaluation.reach import (
    random_goals as reach_random,
)
from app.policies.evaluation.reach import (
    smoothness as reach_smoothness,
)
from app.policies.evaluation.reach import (
    ssm as reach_ssm,
)
from app.policies.evaluation.reach import (
    targets as reach_targets,
)
from app.policies.evaluation.reach import (
    tracker as reach_tracker,
)
from app.policies.evaluation.rows import OnRow, ignore_row
from app.policies.evaluation.safety import ssm as safety
from app.policies.evaluation.sorting import runs as sorting
from app.sim.mocap.importer import Motion

Protocol = Callable[..., dict[str, Any]]

PROTOCOLS: Mapping[str, Protocol] = MappingProxyType(
    {
        "pick-single": pick.run_single,
        "pick-choice": pick.run_choice,
        "pick-tracker": tracker.run_tracker,
        "pick-people": people.run_people,
        "pick-yielding": people.run_yielding,
        "pick-mocap": people.run_mocap,
        "safety-ssm": safety.run_safety,
        "sorting-grid": sorting.run_grid,
        "sorting-tests": sorting.run_tests,
        "reach-targets": reach_targets.run_targets,
        "reach-random": reach_random.run_random,
        "reach-constant": reach_people.run_constant,
        "reach-speeds": reach_people.run_speeds,
        "reach-smoothness": reach_smoothness.run_smoothness,
        "reach-people": reach_people.run_people,
        "reach-tracker": reach_tracker.run_tracker,
        "reach-ssm": reach_ssm.run_ssm,
        "reach-oracle": reach_ceiling.run_oracle,
    }
)
"""Protocol by name; each takes a checkpoint, ``episodes``, ``seed`` and ``on_row``."""
WITH_MOTIONS = frozenset({"pick-mocap"})
"""Protocols that take recorded motion."""
WITH_OR_WITHOUT_MOTIONS = frozenset({"reach-ssm"})
"""Protocols that may be given recorded motion."""
WITHOUT_CHECKPOINT = frozenset({"safety-ssm"})
"""Protocols in which no policy takes part."""
OF_SORTING = frozenset(name for name in PROTOCOLS if name.startswith("sorting-"))
"""Protocols of policies that sort."""
OF_REACHING = frozenset(name for name in PROTOCOLS if name.startswith("reach-"))
"""Protocols of policies that reach goals; all others are of policies that choose and pick."""
MAX_EPISODES = 100_000
"""Most episodes of one evaluation."""
MAX_SORTING_EPISODES = 10_000
"""Most episodes of one pair or one test of the sorting task."""
FEWER_EPISODES: Mapping[str, int] = MappingProxyType(
    {**dict.fromkeys(OF_SORTING, MAX_SORTING_EPISODES), "reach-targets": 2_000}
    | {"reach-smoothness": 5_000, "reach-ssm": 20_000, "reach-oracle": 200}
)
"""Most episodes of protocols that count them per pair or target, or keep whole paths."""


def evaluate(
    name: str,
    checkpoint: Checkpoint | None,
    *,
    episodes: int | None = None,
    seed: int = 11,
    motions: Sequence[Motion] = (),
    on_row: OnRow = ignore_row,
) -> dict[str, Any]:
    """Run a protocol and return its result, ready for JSON.

    Args:
        name: Name of the protocol.
        checkpoint: What is evaluated; None only where no policy takes part.
        episodes: Number of episodes; the protocol's own number by default.
        seed: Seed of the episodes.
        motions: Runs of recorded motion, for the protocols that take them.
        on_row: Told of each row of the result once it is known.

    Raises:
        NotFound: No protocol has that name.
        InvalidInput: The number of episodes or the seed cannot be used, there is no
            checkpoint, it is of another scenario, or there are motions where none are taken
            or none where some are.
    """
    if name not in PROTOCOLS:
        raise NotFound("protocol", name, tuple(PROTOCOLS))
    most = most_episodes(name)
    if episodes is not None and not 1 <= episodes <= most:
        raise InvalidInput("episodes", episodes, f"must lie in [1, {most}]")
    if not 0 <= seed < 2**31:
        raise InvalidInput("seed", seed, "must lie in [0, 2^31)")
    if checkpoint is None and name not in WITHOUT_CHECKPOINT:
        raise InvalidInput("checkpoint", None, f"must name a checkpoint for {name}")
    check_motions(name, [motion.name for motion in motions])
    _check_task(name, checkpoint)
    tested = {} if name in WITHOUT_CHECKPOINT else _identity(checkpoint)
    started = time.process_time()
    more = {"motions": motions} if name in WITH_MOTIONS | WITH_OR_WITHOUT_MOTIONS else {}
    outcome = PROTOCOLS[name](checkpoint, episodes=episodes, seed=seed, on_row=on_row, **more)
    return {
        "protocol": name,
        **tested,
        "seed": seed,
        "episodes": outcome["results"][0]["n"],
        **outcome,
        "cpu_seconds": round(time.process_time() - started, 2),
    }


def default_checkpoint(name: str) -> str:
    """Return the alias of the checkpoint that a protocol measures unless another is named."""
    return {SORTING: "sorting-e0", REACHING: "reach", CHOOSING: "pick"}[_task_measured(name)]


def most_episodes(name: str) -> int:
    """Return how many episodes a protocol runs at most; of each pair, test or target."""
    return FEWER_EPISODES.get(name, MAX_EPISODES)


_POLICIES = {
    CHOOSING: "a policy that picks",
    REACHING: "a policy that reaches goals",
    SORTING: "a policy that sorts",
}


def _task_measured(name: str) -> str:
    """Return what the policies that a protocol measures are for."""
    if name in OF_SORTING:
        return SORTING
    return REACHING if name in OF_REACHING else CHOOSING


def _check_task(name: str, checkpoint: Checkpoint | None) -> None:
    """Check that a checkpoint is of the scenario that a protocol measures."""
    if checkpoint is None or name in WITHOUT_CHECKPOINT:
        return
    wanted, actual = _task_measured(name), task_of(checkpoint)
    if wanted != actual:
        found = checkpoint.manifest["preset"].get("name") or checkpoint.sha256[:12]
        fitting = set(PROTOCOLS) - WITHOUT_CHECKPOINT
        known = sorted(one for one in fitting if _task_measured(one) == actual)
        raise InvalidInput(
            "checkpoint", found, f"must be {_POLICIES[wanted]} for {name}", known
        )


def check_motions(
    name: str, given: Sequence[str], field: str = "motions", how: str = ""
) -> None:
    """Check that motions are given where a protocol takes them, and nowhere else.

    Args:
        name: Name of the protocol.
        given: Names of the motions.
        field: What the caller calls them.
        how: How they are given, for the message.

    Raises:
        InvalidInput: There are some where none are taken, or none.
    """
    if name in WITH_MOTIONS and not given:
        told = f": {how}" if how else ""
        raise InvalidInput(field, [], f"must hold at least one motion for {name}{told}")
    taking = WITH_MOTIONS | WITH_OR_WITHOUT_MOTIONS
    if name not in taking and given:
        rule = f"must not be given to {name}, which takes no recorded motion"
        raise InvalidInput(field, list(given[:3]), rule, sorted(taking))


def _identity(checkpoint: Checkpoint | None) -> dict[str, str]:
    return {} if checkpoint is None else {"checkpoint": checkpoint.sha256}
