"""Evaluation protocols by name, for the command line and evaluation jobs."""

import time
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from app.errors import InvalidInput, NotFound
from app.policies.checkpoints.checkpoint import (
    CHOOSING,
    REACHING,
    SORTING,
    Checkpoint,
    purpose_of,
)
from app.policies.checkpoints.trained_cell import cell_of
from app.policies.evaluation.pick import calibration, people, tracker, worst_people
from app.policies.evaluation.pick import cases as pick_cases
from app.policies.evaluation.pick import ssm as pick_ssm
from app.policies.evaluation.pick import tasks as pick
from app.policies.evaluation.pick.case_variants import run_case_variants
from app.policies.evaluation.pick.episodes import CANDIDATES
from app.policies.evaluation.reach.oracle import run_oracle
from app.policies.evaluation.reach.people import run_constant, run_people, run_speeds
from app.policies.evaluation.reach.random_goals import run_random
from app.policies.evaluation.reach.smoothness import run_smoothness
from app.policies.evaluation.reach.ssm import run_ssm
from app.policies.evaluation.reach.targets import run_targets
from app.policies.evaluation.reach.tracker import run_tracker
from app.policies.evaluation.rows import EvaluationRequest, Json, OnRow, ignore_row
from app.policies.evaluation.safety.ssm import run_safety
from app.policies.evaluation.sorting.benchmark_tasks import run_tests
from app.policies.evaluation.sorting.cycle_time import run_cycle_time
from app.policies.evaluation.sorting.grid import run_grid
from app.policies.evaluation.sorting.people import run_sorting_people
from app.sim.cells.cell import Cell
from app.sim.mocap.importer import Motion
from app.sim.pick.cases import CASES_CELL

Protocol = Callable[[Any, EvaluationRequest], Json]

PROTOCOLS: Mapping[str, Protocol] = MappingProxyType(
    {
        "pick-single": pick.run_single,
        "pick-choice": pick.run_choice,
        "pick-choice-hard": pick.run_choice_hard,
        "pick-cases": pick_cases.run_cases,
        "pick-case-variants": run_case_variants,
        "pick-rest": people.run_rest,
        "risk-calibration": calibration.run_calibration,
        "pick-tracker": tracker.run_tracker,
        "pick-people": people.run_people,
        "pick-yielding": people.run_yielding,
        "pick-mocap": people.run_mocap,
        "pick-worst": worst_people.run_worst,
        "pick-ssm": pick_ssm.run_ssm,
        "safety-ssm": run_safety,
        "sorting-grid": run_grid,
        "sorting-tests": run_tests,
        "sorting-people": run_sorting_people,
        "sorting-cycle-time": run_cycle_time,
        "reach-targets": run_targets,
        "reach-random": run_random,
        "reach-constant": run_constant,
        "reach-speeds": run_speeds,
        "reach-smoothness": run_smoothness,
        "reach-people": run_people,
        "reach-tracker": run_tracker,
        "reach-ssm": run_ssm,
        "reach-oracle": run_oracle,
    }
)
"""Protocol by name."""
WITH_MOTIONS = frozenset({"pick-mocap"})
"""Protocols that take recorded motion."""
WITH_OR_WITHOUT_MOTIONS = frozenset({"reach-ssm", "risk-calibration"})
"""Protocols with optional recorded motion."""
WITHOUT_CHECKPOINT = frozenset({"safety-ssm"})
"""Protocols without a policy."""
OF_SORTING = frozenset({"sorting-grid", "sorting-tests"})
"""Protocols of sorting policies; the pick policy executes full tasks."""
OF_CASES = frozenset({"pick-cases", "pick-case-variants"})
"""Protocols of the case studies, which are laid out for one cell."""
OF_REACHING = frozenset(name for name in PROTOCOLS if name.startswith("reach-"))
"""Protocols of reach policies; all others are of pick policies."""
OF_CHOICE = frozenset(
    {"pick-choice", "pick-choice-hard", "pick-tracker", "pick-people", "pick-yielding"}
    | {"pick-mocap", "pick-worst"}
)
"""Protocols that offer 2 or 3 stations in all rows, and need as many in the cell."""
MAX_EPISODES = 100_000
"""Maximum number of episodes of one evaluation."""
MAX_SORTING_EPISODES = 10_000
"""Maximum number of episodes of one pair or one test of the sorting task."""
FEWER_EPISODES: Mapping[str, int] = MappingProxyType(
    {**dict.fromkeys(OF_SORTING, MAX_SORTING_EPISODES), "reach-targets": 2_000}
    | {"reach-smoothness": 5_000, "reach-ssm": 20_000, "reach-oracle": 200}
    | {"sorting-people": 2_000, "sorting-cycle-time": 2_000}
    | {"pick-cases": 5_000, "pick-case-variants": 100}
)
"""Maximum number of episodes where they count per pair, target or variant, or where paths of
robots or motions of people are stored."""


def evaluate(
    name: str,
    checkpoint: Checkpoint | None,
    *,
    episodes: int | None = None,
    seed: int = 11,
    motions: Sequence[Motion] = (),
    on_row: OnRow = ignore_row,
) -> Json:
    """Run a protocol and return its result, ready for JSON.

    Args:
        checkpoint: Policy; None only for protocols without one.
        episodes: Number of episodes; by default that of the protocol.
        seed: Seed of the episodes.
        motions: Recorded motion, for protocols that use it.
        on_row: Callback for each finished row of the result.

    Raises:
        NotFound: No protocol has that name.
        InvalidInput: The number of episodes or the seed is out of range, the checkpoint is
            missing or of another scenario, or recorded motion is missing or not used.
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
    require_use(name, None if checkpoint is None else checkpoint.sha256)
    tested = {}
    if checkpoint is not None:
        preset = checkpoint.manifest["preset"].get("name")
        check_task(name, checkpoint.manifest, preset or checkpoint.sha256[:12])
        tested = {"checkpoint": checkpoint.sha256}
    started = time.process_time()
    request = EvaluationRequest(episodes=episodes, seed=seed, motions=motions, on_row=on_row)
    outcome = PROTOCOLS[name](checkpoint, request)
    return {
        "protocol": name,
        **tested,
        "seed": seed,
        "episodes": outcome["results"][0]["n"],
        **outcome,
        "cpu_seconds": round(time.process_time() - started, 2),
    }


def require_use(name: str, checkpoint: str | None) -> None:
    """Check that a protocol uses a given checkpoint.

    Raises:
        InvalidInput: It has no policy.
    """
    if checkpoint is not None and name in WITHOUT_CHECKPOINT:
        raise InvalidInput(
            "checkpoint", checkpoint, f"must not be given to {name}, without policy"
        )


def default_checkpoint(name: str) -> str | None:
    """Return the alias of a protocol's default checkpoint; None without a policy."""
    if name in WITHOUT_CHECKPOINT:
        return None
    return {SORTING: "sorting-e0", REACHING: "reach", CHOOSING: "pick"}[task_measured(name)]


def most_episodes(name: str) -> int:
    """Return the maximum number of episodes of a protocol, or of each pair, test or target."""
    return FEWER_EPISODES.get(name, MAX_EPISODES)


_POLICIES = {
    CHOOSING: "a policy that picks",
    REACHING: "a policy that reaches goals",
    SORTING: "a policy that sorts",
}


def task_measured(name: str) -> str:
    """Return the purpose of the policies that a protocol evaluates."""
    if name in OF_SORTING:
        return SORTING
    return REACHING if name in OF_REACHING else CHOOSING


def check_task(name: str, manifest: Mapping[str, Any], found: str) -> None:
    """Check that a checkpoint is of the scenario of a protocol.

    Args:
        found: Name of the checkpoint in the error.

    Raises:
        InvalidInput: It is of another scenario; the rule lists the protocols of its own. Or it
            is of another cell than that of the case studies, of a cell with too few stations,
            of an arm that contacts block, or of other joint limits than those of its cell.
    """
    wanted, actual = task_measured(name), purpose_of(manifest)
    episode = manifest["preset"].get("episode", {})  # presets may leave out fields
    if wanted != actual:
        fitting = set(PROTOCOLS) - WITHOUT_CHECKPOINT
        known = sorted(one for one in fitting if task_measured(one) == actual)
        rule = f"must be {_POLICIES[wanted]} for {name}; protocols of this one"
        rule = f"{rule}: {', '.join(known)}"
    elif name in OF_CASES and manifest["cell"] != CASES_CELL:
        rule = f"must be of the cell {CASES_CELL!r} for {name}, not of {manifest['cell']!r}"
    elif name in OF_CHOICE and (lack := lacks_for_choice(cell_of(manifest))) is not None:
        rule = f"must be of another cell for {name}: its cell {lack}"
    elif name == "reach-oracle" and episode.get("collision") == "blocks":
        rule = f"must be of a policy whose episodes end at contacts for {name}"
    elif name == "reach-ssm" and episode.get("limits") == "authors":
        rule = f"must be of a policy trained within the joint limits of its cell for {name}"
    else:
        return
    raise InvalidInput("checkpoint", found, rule)


def lacks_for_choice(cell: Cell) -> str | None:
    """Return what a cell lacks for protocols that offer several stations; None: nothing."""
    most, n = CANDIDATES[1], len(cell.pick_stations)
    return None if n >= most else f"has {n} cubes and docks, of which {most} are needed"


def check_motions(
    name: str, given: Sequence[str], field: str = "motions", how: str = ""
) -> None:
    """Check that recorded motion is given to protocols that use it, and to no others.

    Args:
        given: Names of the recordings.
        field: Name of the field in the caller's input.
        how: Hint for the message: how recordings are given.

    Raises:
        InvalidInput: Recorded motion is missing, or given to a protocol without it.
    """
    if name in WITH_MOTIONS and not given:
        hint = f": {how}" if how else ""
        raise InvalidInput(field, [], f"must hold at least one motion for {name}{hint}")
    using = WITH_MOTIONS | WITH_OR_WITHOUT_MOTIONS
    if name not in using and given:
        rule = f"must not be given to {name}, which takes no recorded motion"
        raise InvalidInput(field, list(given[:3]), rule, sorted(using))
