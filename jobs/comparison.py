"""Comparison of jobs: the fields that differ, and learning curves with a band over seeds.

Jobs that differ in nothing but the seed form a group; its curve is the mean over the seeds, its
band reaches from the least to the greatest of them.
"""

import csv
import io
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydantic import ValidationError

from app.errors import InvalidInput
from app.policies.configs import presets
from app.sim.core.arrays import Vec
from app.store import jobs, metrics
from app.store.engine import Store
from app.store.records import JobRecord, MetricRow
from jobs.job_changes import JobChanges
from jobs.spec import SweepSpec, TrainSpec, parse_spec

MAX_JOBS = 20
"""Most jobs of one comparison."""
DEFAULT_QUANTITY = "success"


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """Jobs that differ in nothing but the seed, with one quantity of their curves."""

    label: str
    """Their values of the fields that differ; the preset where none does."""
    jobs: tuple[str, ...]
    """Their ids."""
    mean: Vec
    """Mean over the jobs that have reached a step, shape (n_steps,); NaN where none has."""
    low: Vec
    """Least value, shape (n_steps,)."""
    high: Vec
    """Greatest value, shape (n_steps,)."""
    n: Vec
    """Number of jobs that have reached the step, shape (n_steps,)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class JobComparison:
    """Several jobs side by side."""

    jobs: tuple[JobRecord, ...]
    """The jobs, in the given order."""
    differences: Mapping[str, tuple[Any, ...]]
    """Fields that differ, by dotted name: the value of each job, None if absent."""
    quantities: tuple[str, ...]
    """Quantities that the curves have."""
    quantity: str | None
    """The compared one; None without points."""
    steps: tuple[int, ...]
    """Environment steps of all curves, increasing; of many, every n-th."""
    groups: tuple[Group, ...]
    """The groups, trainings only."""


def compare(store: Store, job_ids: Sequence[str], quantity: str | None = None) -> JobComparison:
    """Compare jobs.

    Args:
        job_ids: The jobs, 1 to 20, each once.
        quantity: Name of the curves to compare; success by default, where it is recorded.

    Raises:
        NotFound: There is no such job.
        InvalidInput: Too many jobs, one twice, or no job has that quantity.
    """
    found = read_jobs(store, job_ids)
    fields = [settings_of(job) for job in found]
    trained = [job for job in found if job.kind == "train"]
    curves = {job.id: metrics.thinned_curve(store, job.id) for job in trained}
    names = recorded(curves.values())
    if quantity is not None and quantity not in names:
        rule = "is not recorded by these jobs"
        raise InvalidInput("quantity", quantity, rule, names)
    first = next(iter(names), None)
    shown = quantity or (DEFAULT_QUANTITY if DEFAULT_QUANTITY in names else first)
    lines = {
        job_id: [(row.step, row.values.get(shown or "")) for row in curve]
        for job_id, curve in curves.items()
    }
    steps = sorted(
        {step for line in lines.values() for step, value in line if value is not None}
    )
    steps = steps[:: -metrics.every_nth(len(steps))][::-1]
    return JobComparison(
        jobs=found,
        differences=differing(fields),
        quantities=names,
        quantity=shown,
        steps=tuple(steps),
        groups=_groups(trained, lines, steps),
    )


def read_jobs(store: Store, job_ids: Sequence[str]) -> tuple[JobRecord, ...]:
    """Return the jobs to compare.

    Raises:
        NotFound: There is no such job.
        InvalidInput: None, too many jobs, or one twice.
    """
    if not 1 <= len(job_ids) <= MAX_JOBS:
        raise InvalidInput("job", len(job_ids), f"must name 1 to {MAX_JOBS} jobs")
    for place, job_id in enumerate(job_ids):
        if job_id in job_ids[:place]:
            raise InvalidInput(f"job[{place}]", job_id, "must be named once")
    return tuple(jobs.get_job(store, job_id) for job_id in job_ids)


def recorded(curves: Iterable[Sequence[MetricRow]]) -> tuple[str, ...]:
    """Return the names of the quantities with a value in some curve, in order of appearance."""
    names = dict.fromkeys(
        name
        for curve in curves
        for row in curve
        for name, value in row.values.items()
        if value is not None
    )
    return tuple(names)


def settings_of(job: JobRecord) -> dict[str, Any]:
    """Return what a job computes from, by dotted name: spec and preset with all defaults.

    The checkpoint is the one that its alias named when the job was posted.
    """
    spec = dict(job.spec)
    with suppress(ValidationError, InvalidInput):  # of an earlier version: as it was posted
        given = parse_spec(job.spec)
        spec = given.model_dump(mode="json", exclude=set(JobChanges.model_fields))
        if isinstance(given, TrainSpec | SweepSpec):
            whole = presets.resolve(given.preset, given.overrides).model_dump(mode="json")
            head = {"kind": job.kind, "preset": whole.pop("name"), **whole}
            spec = head | {name: spec[name] for name in spec if name != "overrides"}
    if job.checkpoint is not None:
        spec["checkpoint"] = job.checkpoint
    return _flat(spec)


def differing(fields: Sequence[Mapping[str, Any]]) -> dict[str, tuple[Any, ...]]:
    """Return the fields with more than one value: the value of each job, None if absent."""
    names = dict.fromkeys(name for one in fields for name in one)
    rows = {name: tuple(one.get(name) for one in fields) for name in names}
    return {name: row for name, row in rows.items() if any(v != row[0] for v in row)}


def band(
    curves: Sequence[Sequence[tuple[int, float | None]]], steps: Sequence[int]
) -> tuple[Vec, Vec, Vec, Vec]:
    """Return mean, least, greatest and number of several curves at given steps.

    A curve counts between its first and last point and is interpolated linearly between two.

    Args:
        curves: Points of each curve: step and value, None where not defined.
        steps: The steps, increasing.

    Returns:
        Four arrays of shape (n_steps,); NaN and 0 where no curve has a point.
    """
    at = np.asarray(steps, dtype=float)
    rows = np.full((len(curves), len(at)), np.nan)
    for row, curve in zip(rows, curves, strict=True):
        points = [(step, value) for step, value in curve if value is not None]
        if points:
            x, y = np.array(points, dtype=float).T
            row[:] = np.interp(at, x, y, left=np.nan, right=np.nan)
    known = np.ma.masked_invalid(rows)
    mean, low, high = known.mean(axis=0), known.min(axis=0), known.max(axis=0)
    n = known.count(axis=0).astype(float)
    return mean.filled(np.nan), low.filled(np.nan), high.filled(np.nan), n


def curves_as_csv(store: Store, job_ids: Sequence[str]) -> str:
    """Return the curves of several jobs as CSV, one row per job and step.

    Raises:
        NotFound, InvalidInput: As for :func:`read_jobs`.
    """
    found = read_jobs(store, job_ids)
    curves = {job.id: metrics.thinned_curve(store, job.id) for job in found}
    names = recorded(curves.values())
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("job", "number", "name", "preset", "seed", "step", *names))
    for job in found:
        head = (job.id, job.number, _plain(job.name), job.preset, job.seed)
        for row in curves[job.id]:
            writer.writerow((*head, row.step, *(row.values.get(name) for name in names)))
    return text.getvalue()


def _plain(name: str | None) -> str | None:
    """Return a name that no spreadsheet takes for a formula."""
    return f"'{name}" if name and name[0] in "=+-@" else name


def _groups(
    trained: Sequence[JobRecord],
    lines: Mapping[str, Sequence[tuple[int, float | None]]],
    steps: Sequence[int],
) -> tuple[Group, ...]:
    members: dict[str, tuple[dict[str, Any], list[str]]] = {}
    for job in trained:
        own = {name: value for name, value in settings_of(job).items() if name != "seed"}
        members.setdefault(repr(sorted(own.items())), (own, []))[1].append(job.id)
    differences = differing([own for own, _ in members.values()])
    groups = []
    for place, (own, ids) in enumerate(members.values()):
        mean, low, high, n = band([lines[one] for one in ids], steps)
        values = {name: row[place] for name, row in differences.items()}
        label = _label(values) or str(own.get("preset"))
        groups.append(Group(label=label, jobs=tuple(ids), mean=mean, low=low, high=high, n=n))
    return _distinct(groups, {job.id: job.number for job in trained})


def _distinct(groups: Sequence[Group], numbers: Mapping[str, int]) -> tuple[Group, ...]:
    """Return the groups; those of the same label have the numbers of their jobs in it."""
    labels = Counter(group.label for group in groups)
    return tuple(
        replace(one, label=f"{one.label} (job {', '.join(str(numbers[i]) for i in one.jobs)})")
        if labels[one.label] > 1
        else one
        for one in groups
    )


def _label(values: Mapping[str, Any]) -> str:
    """Return a group's values of the fields that differ, as short text."""
    if "preset" in values:
        return str(values["preset"])
    parts = [f"{name.rpartition('.')[2]} {value}" for name, value in values.items()]
    more = f", {len(parts) - 3} more" if len(parts) > 3 else ""
    return ", ".join(parts[:3]) + more


def _flat(value: Mapping[str, Any], place: str = "") -> dict[str, Any]:
    """Return the leaves of nested objects by dotted name."""
    leaves: dict[str, Any] = {}
    for name, member in value.items():
        path = f"{place}{name}"
        if isinstance(member, Mapping):
            leaves |= _flat(member, f"{path}.")
        else:
            leaves[path] = member
    return leaves
