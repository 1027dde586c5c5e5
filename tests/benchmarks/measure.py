"""How benchmarks measure and print: one table for people, with ``--json`` one object.

Every row is timed in processor seconds of this process (``time.process_time``), in rounds that
go through all rows in turn, so that a machine that slows down slows all of them.
"""

import argparse
import json
import os
import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from app.provenance import describe
from app.sim.core.arrays import Vec

Row = dict[str, object]
QUANTILES = ("p50_ms", "p99_ms", "p999_ms")
"""Columns of the quantiles of a time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """One thing that is measured."""

    name: str
    """Name of its row, such as ``pick/numba``."""
    batch: int
    """Environments or candidates handled per call."""
    run: Callable[[], object]
    """One call."""


def arguments(bench: str, rounds: int = 5, seconds: float = 1.0) -> argparse.Namespace:
    """Read ``--json``, ``--rounds``, ``--seconds`` and ``--seed`` from the command line."""
    parser = argparse.ArgumentParser(prog=f"bench {bench}")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--rounds", type=int, default=rounds, help="rounds over all rows")
    parser.add_argument("--seconds", type=float, default=seconds, help="per row and round")
    parser.add_argument("--seed", type=int, default=11)
    return parser.parse_args()


def cpu_seconds_per_call(run: Callable[[], object], seconds: float) -> float:
    """Call ``run`` for about ``seconds`` of processor time; return the mean time of a call."""
    begin, calls = time.process_time(), 0
    while (spent := time.process_time() - begin) < seconds:
        run()
        calls += 1
    return spent / calls


def rounds_over(subjects: Sequence[Subject], rounds: int, seconds: float) -> list[list[float]]:
    """Return processor seconds per call of each subject in each round, after one warm-up."""
    for subject in subjects:
        subject.run()
    times: list[list[float]] = [[] for _ in subjects]
    for _ in range(rounds):
        for subject, found in zip(subjects, times, strict=True):
            found.append(cpu_seconds_per_call(subject.run, seconds))
    return times


def row(
    subject: Subject, values: Sequence[float], unit: str, threads: int = 1, **more: object
) -> Row:
    """Make a result row: the median over the rounds with the least and the greatest.

    Args:
        subject: What was measured.
        values: Its value in each round.
        unit: Their unit.
        threads: Threads that ran at once.
        **more: Further columns.
    """
    return row_of(subject.name, values, unit, threads=threads, batch=subject.batch, **more)


def row_of(name: str, values: Sequence[float], unit: str, **more: object) -> Row:
    """Make a result row of anything that has a value in each round."""
    return {
        "name": name,
        **more,
        "value": statistics.median(values),
        "low": min(values),
        "high": max(values),
        "unit": unit,
    }


def quantiles_ms(times: Vec) -> Row:
    """Return the columns of median, 99th and 99.9th percentile of times [ms]."""
    return dict(zip(QUANTILES, np.percentile(times, (50.0, 99.0, 99.9)).tolist(), strict=True))


def row_without(name: str, reason: str) -> Row:
    """Make the row of something that could not be measured: it is said, not left out."""
    return {"name": name, "value": None, "note": reason}


def report(
    bench: str,
    rows: Iterable[Row],
    options: argparse.Namespace,
    shown: Sequence[str] = (),
    **stated: object,
) -> None:
    """Print the rows: as a table, or with ``--json`` as one object.

    Args:
        bench: Name of the benchmark.
        rows: Its rows.
        options: From :func:`arguments`.
        shown: Further columns of the table.
        **stated: What else the result says of how it was measured.
    """
    results = list(rows)
    settings = {
        "rounds": options.rounds,
        "seconds": options.seconds,
        "load": round(os.getloadavg()[0], 2),
        **stated,
    }
    if options.json:
        print(
            json.dumps(
                {
                    "bench": bench,
                    "seed": options.seed,
                    "settings": settings,
                    "results": results,
                    "machine": describe(),
                }
            )
        )
        return
    machine = describe()
    print(f"{bench}, {machine['cores']} cores of {machine['cpu']}, load {settings['load']}")
    for one in results:
        if one["value"] is None:
            print(f"  {one['name']:<24} {one['note']}")
            continue
        count = f"batch {one['batch']}" if "batch" in one else ""
        more = "".join(f"  {key} {one[key]:.4g}" for key in (*QUANTILES, *shown) if key in one)
        print(
            f"  {one['name']:<24} {count:<11} {one['value']:>12,.4g} {one['unit']}"
            f"  ({one['low']:,.4g} to {one['high']:,.4g}){more}"
        )
