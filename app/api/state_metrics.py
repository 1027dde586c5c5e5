"""Metrics that are read from the service at a scrape: live worlds, trackers, sockets, jobs."""

import shutil
from collections.abc import Callable, Iterator
from contextlib import suppress

from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    HistogramMetricFamily,
    Metric,
)
from prometheus_client.registry import Collector

from app.api.motion.load import MAX_SOCKETS
from app.api.services import MAX_VIEWERS, Services
from app.live.snapshot import WorldSnapshot
from app.storage_errors import StorageFull, StorageUnavailable
from app.store.cursors import MAX_PAGE
from app.store.database.size import size_of
from app.store.jobs import count_jobs, list_jobs
from app.store.records import JobRecord

Kind = type[GaugeMetricFamily | CounterMetricFamily]
WORLD_METRICS: tuple[tuple[Kind, str, str, Callable[[WorldSnapshot], float | None]], ...] = (
    (
        GaugeMetricFamily,
        "tandem_live_safety_on",
        "Whether the robot of a live world obeys the safety layer.",
        lambda world: world.safety.on,
    ),
    (
        GaugeMetricFamily,
        "tandem_live_override_ratio",
        "Speed override that a live world executes, 0 to 1.",
        lambda world: world.safety.override,
    ),
    (
        GaugeMetricFamily,
        "tandem_live_stop_ratio",
        "Share of the time of motions with override 0, since the reset of a live world.",
        lambda world: (
            world.safety.stopped_s / world.safety.moving_s if world.safety.moving_s else None
        ),
    ),
    (
        CounterMetricFamily,
        "tandem_live_moving_seconds",
        "Time of motions of a live world.",
        lambda world: world.safety.moving_s,
    ),
    (
        CounterMetricFamily,
        "tandem_live_stopped_seconds",
        "Part of the time of motions with override 0.",
        lambda world: world.safety.stopped_s,
    ),
    (
        CounterMetricFamily,
        "tandem_live_contacts",
        "Contacts of the moving robot of a live world.",
        lambda world: world.counters.contacts,
    ),
    (
        GaugeMetricFamily,
        "tandem_live_outside_training",
        "Inputs of a live world outside the training range of its policy.",
        lambda world: len(world.outside),
    ),
)
"""Kind, name, description and value of each metric of live worlds; a value of None is left out.

Names of counters lack ``_total``; a counter starts again at the reset of its world.
"""


class StateMetrics(Collector):
    """Reads the state of a service."""

    def __init__(self, services: Services) -> None:
        self._services = services

    def collect(self) -> Iterator[Metric]:
        """Yield the metrics; those of the database are left out while it does not answer."""
        yield from service_metrics(self._services)
        yield from world_metrics(self._services)
        try:
            stored = list(stored_metrics(self._services))
        except (StorageUnavailable, StorageFull):
            stored = []
        yield GaugeMetricFamily(
            "tandem_database_up", "Whether the database answers.", float(bool(stored))
        )
        yield from stored


def service_metrics(services: Services) -> Iterator[Metric]:
    """Yield the metrics of the service beside its live worlds and its database."""
    yield GaugeMetricFamily(
        "tandem_ready", "Whether the service can decide.", services.readiness.ready
    )
    yield GaugeMetricFamily(
        "tandem_queue_waiting",
        "Whether jobs cannot start or be written for now; /readyz contains the reason.",
        services.supervisor.waiting is not None,
    )
    yield GaugeMetricFamily(
        "tandem_damaged_checkpoints",
        "Checkpoints that were found damaged.",
        len(services.checkpoints.damaged),
    )
    space = GaugeMetricFamily(
        "tandem_data_free_bytes", "Free space of the disk of the data folder."
    )
    with suppress(OSError):  # a disk with errors has no value
        space.add_metric((), shutil.disk_usage(services.data).free)
    yield space
    ages = GaugeMetricFamily(
        "tandem_tracker_age_seconds",
        "Time since the newest frame of a tracker.",
        labels=("tracker", "cell"),
    )
    for one in services.trackers.all():
        ages.add_metric((one.id, one.cell), one.since_frame_s())
    yield ages
    sockets = GaugeMetricFamily("tandem_sockets_open", "Open sockets.", labels=("kind",))
    sockets.add_metric(("motion",), services.motion_load.n_open)
    sockets.add_metric(("viewer",), MAX_VIEWERS - services.viewers._value)
    limits = GaugeMetricFamily(
        "tandem_sockets_limit", "Largest number of open sockets.", labels=("kind",)
    )
    limits.add_metric(("motion",), MAX_SOCKETS)
    limits.add_metric(("viewer",), MAX_VIEWERS)
    yield from (sockets, limits)


def world_metrics(services: Services) -> Iterator[Metric]:
    """Yield the metrics of the live worlds."""
    of_snapshots = [
        (kind(name, text, labels=("world", "cell")), value)
        for kind, name, text, value in WORLD_METRICS
    ]
    ages = GaugeMetricFamily(
        "tandem_live_tick_age_seconds",
        "Time since the last tick of a live world.",
        labels=("world",),
    )
    lateness = HistogramMetricFamily(
        "tandem_live_tick_lateness_seconds",
        "Time from the due time of a tick of a live world to its start.",
        labels=("world",),
    )
    for world_id, world in services.worlds.copy().items():
        snapshot, late = world.handle.snapshot(), world.lateness
        for family, value in of_snapshots:
            if (found := value(snapshot)) is not None:
                family.add_metric((world_id, snapshot.cell), found)
        ages.add_metric((world_id,), world.handle.since_snapshot_s())
        lateness.add_metric((world_id,), late.buckets(), late.total_s)
    yield from (family for family, _ in of_snapshots)
    yield from (ages, lateness)


def stored_metrics(services: Services) -> Iterator[Metric]:
    """Yield the metrics of the database."""
    yield GaugeMetricFamily(
        "tandem_database_size_bytes",
        "Size of the database on its disk.",
        size_of(services.store),
    )
    counts = GaugeMetricFamily("tandem_jobs", "Jobs by state.", labels=("state",))
    for state, n in count_jobs(services.store).items():
        counts.add_metric((state,), n)
    names = ("job_id", "kind", "preset")
    steps = GaugeMetricFamily("tandem_job_steps", "Steps done by a running job.", labels=names)
    total = GaugeMetricFamily("tandem_job_total_steps", "Steps of a running job.", labels=names)
    for job in _running(services):
        labels = job.id, job.kind, job.preset or ""
        steps.add_metric(labels, job.step)
        if job.total_steps is not None:
            total.add_metric(labels, job.total_steps)
    yield from (counts, steps, total)


def _running(services: Services) -> Iterator[JobRecord]:
    """Yield all running jobs, page by page."""
    cursor, more = None, True
    while more:
        page = list_jobs(services.store, state="running", cursor=cursor, limit=MAX_PAGE)
        yield from page.items
        cursor = page.next_cursor
        more = cursor is not None
