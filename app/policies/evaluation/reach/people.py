"""Protocols ``reach-people``, ``reach-constant`` and ``reach-speeds``: other people.

``reach-people``: nobody to four walking cylinders, without training again, the nearest seen and
all averaged. Nobody and one person are the same by both.
``reach-constant``: speed and radius constant in each episode, beside the usual person.
``reach-speeds``: a person of 0.25, 0.5 and 1.0 m/s; the speed's limits do not apply, else
0.25 m/s would be standing still (METHOD 2.1).

``-rollout`` looks ahead with the policy (``rollout.py``), at all people at once.

All go round the grid's targets, with the same goals in every row.

Source: thesis 4.4.3; METHOD 2.6, and 4 for several people.
"""

from dataclasses import replace
from itertools import product
from typing import Any

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.reach.bench import ReachBench, direct_ways, ending, walker_of
from app.policies.evaluation.rows import OnRow, ignore_row
from app.policies.inference.controllers import InferenceMode, inference_modes_of
from app.sim.cells.cell import Cell
from app.sim.cells.people import FixedSpeedWalker
from app.sim.people.kernels.people import MAX_PEOPLE
from app.sim.scene.scene import HumanKind

DEFAULT_EPISODES = 1000
"""METHOD 2.6."""
TARGET_EPISODES = 5400
"""Episodes of each row of ``reach-constant``: as many as ``reach-targets`` plays."""
WAYS = (InferenceMode.DIRECT, InferenceMode.AVERAGED, InferenceMode.DIRECT_ROLLOUT)
"""Ways of asking a policy about several people; ``direct`` sees the nearest."""
KINDS: tuple[HumanKind, ...] = ("walker", "constant")
"""Who walks: as usual, and with one speed and radius per episode."""
SPEEDS = (0.25, 0.5, 1.0)
"""Of people [m/s] (METHOD 2.6)."""


def run_people(
    checkpoint: Checkpoint, *, episodes: int | None, seed: int, on_row: OnRow = ignore_row
) -> dict[str, Any]:
    """Evaluate beside nobody to four walkers.

    Args:
        checkpoint: What acts.
        episodes: Number of episodes of each row, by default 1000.
        seed: Seed of the episodes.
        on_row: Told of each row once it is known.
    """
    bench = ReachBench(checkpoint, seed, on_row)
    ways = [how for how in WAYS if how in inference_modes_of(bench.actor)]
    rows = [
        (n, how)
        for n in range(MAX_PEOPLE + 1)
        for how in ways
        if n > 1 or (how != "averaged" and n) or how == "direct"
    ]
    bench.n_rows = len(rows)
    goals = bench.target_goals(episodes or DEFAULT_EPISODES)
    for n, how in rows:
        settings = replace(bench.usual, people=KINDS[:1] * n)
        played = bench.play(settings, goals, how)
        name = f"{n}-people" + (f"-{how}" if n > 1 else ending(how))
        row = played.row(name)
        row["starts_redrawn"] = float((played.redrawn > 0).mean())
        bench.add(row, settings, "grid", how)
    bench.recheck(replace(bench.usual, people=KINDS[:1] * 2), goals)
    return bench.result()


def run_constant(
    checkpoint: Checkpoint, *, episodes: int | None, seed: int, on_row: OnRow = ignore_row
) -> dict[str, Any]:
    """Evaluate beside people whose speed and radius are constant in each episode.

    Args:
        checkpoint: What acts.
        episodes: Number of episodes of each row, by default 5400.
        seed: Seed of the episodes.
        on_row: Told of each row once it is known.
    """
    bench = ReachBench(checkpoint, seed, on_row)
    ways = direct_ways(bench.actor)
    bench.n_rows = len(ways) * len(KINDS)
    goals = bench.target_goals(episodes or TARGET_EPISODES)
    for how, kind in product(ways, KINDS):
        settings = replace(bench.usual, people=(kind,))
        row = bench.play(settings, goals, how).row(kind + ending(how))
        bench.add(row, settings, "grid", how)
    return bench.result()


def run_speeds(
    checkpoint: Checkpoint, *, episodes: int | None, seed: int, on_row: OnRow = ignore_row
) -> dict[str, Any]:
    """Evaluate beside people of a given speed.

    Args:
        checkpoint: What acts.
        episodes: Number of episodes of each row, by default 1000.
        seed: Seed of the episodes.
        on_row: Told of each row once it is known.
    """
    bench = ReachBench(checkpoint, seed, on_row)
    ways = direct_ways(bench.actor)
    bench.n_rows = len(ways) * len(SPEEDS)
    goals = bench.target_goals(episodes or DEFAULT_EPISODES)
    settings = replace(bench.usual, people=("fixed-speed",))
    for how, speed in product(ways, SPEEDS):
        cell = at_speed(bench.cell, speed)
        played = bench.play(settings, goals, how, cell=cell)
        row = played.row(f"{speed:g}-m-s{ending(how)}")
        bench.add(row, settings, "grid", how, cell=cell, speed_m_s=speed)
    return bench.result()


def at_speed(cell: Cell, speed: float) -> Cell:
    """Return a cell with one cylinder that walks at a given speed [m/s], else as its own.

    Raises:
        InvalidInput: The cell has none.
    """
    walker = walker_of(cell)
    kept = set(FixedSpeedWalker.model_fields) & set(type(walker).model_fields) - {
        "kind",
        "speed",
    }
    fields = {name: getattr(walker, name) for name in kept}
    person = FixedSpeedWalker(kind="fixed-speed", speed=speed, **fields)
    return cell.model_copy(update={"people": (person,)})
