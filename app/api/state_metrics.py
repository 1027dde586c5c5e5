"""Metrics that are read from the service at a scrape: live worlds, trackers, sockets, jobs."""

import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily
from prometheus_client.registry import Collector

from app.api.motion.load import MAX_SOCKETS
from app.api.services import MAX_VIEWERS, Services
from app.live.snapshot import WorldSnapshot
from app.storage_errors import StorageFull, StorageUnavailable
from app.store.cursors import MAX_PAGE
from app.store.database.size import size_of
from app.store.jobs import count_jobs, list_jobs
from app.store.records import JobRecord

Samples = Iterable[tuple[tuple[str, ...], float]]
"""Values of a metric with the values of its labels."""


@dataclass(frozen=True, slots=True)
class StateMetric:
    """A metric that is read from the service."""

    name: str
    """Name of the metric; a counter's without ``_total``."""
    text: str
    """Description."""
    labels: tuple[str, ...]
    """Names of the labels."""
    read: Callable[[Services], Samples]
    """Returns the samples."""
    counts: bool = False
    """Whether it is a counter; a counter of a live world starts again at its reset."""


class StateMetrics(Collector):
    """Reads the state of a service."""

    def __init__(self, services: Services) -> None:
        self._services = services

    def collect(self) -> Iterator[Any]:
        """Yield the metrics; those of the database are left out while it does not answer."""
        for one in STATE_METRICS:
            yield _family(one, one.read(self._services))
        yield self._lateness()
        try:
            stored = [_family(one, list(one.read(self._services))) for one in STORED_METRICS]
        except (StorageUnavailable, StorageFull):
            stored = []
        up = GaugeMetricFamily("tandem_database_up", "Whether the database answers.")
        up.add_metric((), float(bool(stored)))
        yield from (up, *stored)

    def _lateness(self) -> HistogramMetricFamily:
        family = HistogramMetricFamily(
            "tandem_live_tick_lateness_seconds",
            "Time from the due time of a tick of a live world to its start.",
            labels=("world",),
        )
        for world_id, world in self._services.worlds.copy().items():
            late = world.lateness
            family.add_metric((world_id,), late.buckets(), late.total_s)
        return family


def _family(one: StateMetric, samples: Samples) -> GaugeMetricFamily | CounterMetricFamily:
    kind = CounterMetricFamily if one.counts else GaugeMetricFamily
    family = kind(one.name, one.text, labels=one.labels)
    for labels, value in samples:
        family.add_metric(labels, value)
    return family


def _of_worlds(
    value: Callable[[WorldSnapshot], float | None],
) -> Callable[[Services], Samples]:
    def read(services: Services) -> Samples:
        for world_id, world in services.worlds.copy().items():
            snapshot = world.handle.snapshot()
            if (found := value(snapshot)) is not None:
                yield (world_id, snapshot.cell), float(found)

    return read


def _stop_ratio(snapshot: WorldSnapshot) -> float | None:
    safety = snapshot.safety
    return safety.stopped_s / safety.moving_s if safety.moving_s > 0.0 else None


def _tick_ages(services: Services) -> Samples:
    for world_id, world in services.worlds.copy().items():
        yield (world_id,), world.handle.since_snapshot_s()


def _tracker_ages(services: Services) -> Samples:
    for one in services.trackers.all():
        yield (one.id, one.cell), one.since_frame_s()


def _sockets(services: Services) -> Samples:
    yield ("motion",), services.motion_load.n_open
    yield ("viewer",), MAX_VIEWERS - services.viewers._value


def _limits(_services: Services) -> Samples:
    yield ("motion",), MAX_SOCKETS
    yield ("viewer",), MAX_VIEWERS


def _running(services: Services) -> Iterator[JobRecord]:
    """Yield all running jobs, page by page."""
    cursor, more = None, True
    while more:
        page = list_jobs(services.store, state="running", cursor=cursor, limit=MAX_PAGE)
        yield from page.items
        cursor = page.next_cursor
        more = cursor is not None


def _free_space(services: Services) -> Samples:
    with suppress(OSError):  # a disk with errors has no value
        yield (), shutil.disk_usage(services.data).free


def _steps(services: Services) -> Samples:
    for job in _running(services):
        yield (job.id, job.kind, job.preset or ""), job.step


def _total_steps(services: Services) -> Samples:
    for job in _running(services):
        if job.total_steps is not None:
            yield (job.id, job.kind, job.preset or ""), job.total_steps


_WORLD, _JOB = ("world", "cell"), ("job_id", "kind", "preset")
STATE_METRICS = (
    StateMetric(
        "tandem_ready",
        "Whether the service can decide.",
        (),
        lambda services: [((), services.readiness.ready)],
    ),
    StateMetric(
        "tandem_queue_waiting",
        "Whether jobs cannot start or be written for now; /readyz contains the reason.",
        (),
        lambda services: [((), services.supervisor.waiting is not None)],
    ),
    StateMetric(
        "tandem_data_free_bytes",
        "Free space of the disk of the data folder.",
        (),
        _free_space,
    ),
    StateMetric(
        "tandem_damaged_checkpoints",
        "Checkpoints that were found damaged.",
        (),
        lambda services: [((), len(services.checkpoints.damaged))],
    ),
    StateMetric(
        "tandem_live_safety_on",
        "Whether the robot of a live world obeys the safety layer.",
        _WORLD,
        _of_worlds(lambda world: world.safety.on),
    ),
    StateMetric(
        "tandem_live_override_ratio",
        "Speed override that a live world executes, 0 to 1.",
        _WORLD,
        _of_worlds(lambda world: world.safety.override),
    ),
    StateMetric(
        "tandem_live_stop_ratio",
        "Share of the time of motions with override 0, since the reset of a live world.",
        _WORLD,
        _of_worlds(_stop_ratio),
    ),
    StateMetric(
        "tandem_live_moving_seconds",
        "Time of motions of a live world.",
        _WORLD,
        _of_worlds(lambda world: world.safety.moving_s),
        counts=True,
    ),
    StateMetric(
        "tandem_live_stopped_seconds",
        "Part of the time of motions with override 0.",
        _WORLD,
        _of_worlds(lambda world: world.safety.stopped_s),
        counts=True,
    ),
    StateMetric(
        "tandem_live_contacts",
        "Contacts of the moving robot of a live world.",
        _WORLD,
        _of_worlds(lambda world: world.counters.contacts),
        counts=True,
    ),
    StateMetric(
        "tandem_live_outside_training",
        "Inputs of a live world outside the training range of its policy.",
        _WORLD,
        _of_worlds(lambda world: len(world.outside)),
    ),
    StateMetric(
        "tandem_live_tick_age_seconds",
        "Time since the last tick of a live world.",
        ("world",),
        _tick_ages,
    ),
    StateMetric(
        "tandem_tracker_age_seconds",
        "Time since the newest frame of a tracker.",
        ("tracker", "cell"),
        _tracker_ages,
    ),
    StateMetric("tandem_sockets_open", "Open sockets.", ("kind",), _sockets),
    StateMetric("tandem_sockets_limit", "Largest number of open sockets.", ("kind",), _limits),
)
STORED_METRICS = (
    StateMetric(
        "tandem_database_size_bytes",
        "Size of the database on its disk.",
        (),
        lambda services: [((), size_of(services.store))],
    ),
    StateMetric(
        "tandem_jobs",
        "Jobs by state.",
        ("state",),
        lambda services: (((state,), n) for state, n in count_jobs(services.store).items()),
    ),
    StateMetric("tandem_job_steps", "Steps done by a running job.", _JOB, _steps),
    StateMetric("tandem_job_total_steps", "Steps of a running job.", _JOB, _total_steps),
)
