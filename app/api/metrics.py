"""Metrics for Prometheus: counted at requests, and read from the service at a scrape.

Every application has its own registry. ``docs/operations.md`` lists the metrics.
"""

import platform
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from prometheus_client import (
    CollectorRegistry,
    Counter,
    GCCollector,
    Histogram,
    Info,
    PlatformCollector,
    ProcessCollector,
)
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily
from prometheus_client.registry import Collector

from app.api.motion.load import MAX_SOCKETS
from app.api.services import MAX_VIEWERS, Services
from app.errors import StorageFull, StorageUnavailable
from app.live.snapshot import WorldSnapshot
from app.provenance import describe
from app.store.jobs import count_jobs, list_jobs

BUCKETS_S = (
    *(0.0001, 0.0002, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05),
    *(0.1, 0.2, 0.5, 1.0, 2.0, 5.0),
)
"""Upper bounds of the durations of requests [s]."""
METHODS = frozenset(("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "MESSAGE"))
UNROUTED = "none"
"""Endpoint of a request that no route answers: refused before, or unknown."""


class Metrics:
    """What is counted while requests are answered; safe to use from any thread.

    Args:
        version: Version of the service.
    """

    def __init__(self, version: str) -> None:
        self.registry = CollectorRegistry()
        """The metrics of this application."""
        self._requests = Histogram(
            "tandem_request_duration_seconds",
            "Time from a request to the head of its answer, or of a socket's message to its "
            "answer (method MESSAGE).",
            ("method", "endpoint", "status"),
            buckets=BUCKETS_S,
            registry=self.registry,
        )
        self._outside = Counter(
            "tandem_decisions_outside_training",
            "Decisions with an input outside the training range or a joint outside its limits.",
            ("endpoint",),
            registry=self.registry,
        )
        build = {
            "version": version,
            "commit": str(describe()["commit"] or ""),
            "python": platform.python_version(),
        }
        Info("tandem_build", "Version of the service.", registry=self.registry).info(build)
        for collector in (ProcessCollector, PlatformCollector, GCCollector):
            collector(registry=self.registry)
        self._state: ServiceState | None = None
        self._children: dict[tuple[str, str, int], Histogram] = {}

    def observe(self, method: str, endpoint: str, status: int, seconds: float) -> None:
        """Count an answer.

        Args:
            method: HTTP method, or ``MESSAGE`` for a message on a socket.
            endpoint: Path of the route, with its parameters' names.
            status: Status of the answer.
            seconds: Time to the answer [s].
        """
        key = method, endpoint, status
        child = self._children.get(key)
        if child is None:
            known = method if method in METHODS else "other"
            child = self._children[key] = self._requests.labels(known, endpoint, status)
        child.observe(seconds)

    def count_outside(self, endpoint: str, *fields: Sequence[object]) -> None:
        """Count a decision if one of its lists of fields outside a range is not empty."""
        if any(fields):
            self._outside.labels(endpoint).inc()

    def watch(self, services: Services) -> None:
        """Read the state of a service at each scrape, in place of one before."""
        if self._state is not None:
            self.registry.unregister(self._state)
        self._state = ServiceState(services)
        self.registry.register(self._state)


Labelled = Iterable[tuple[tuple[str, ...], float]]
"""Values with their labels."""


@dataclass(frozen=True, slots=True)
class StateMetric:
    """A metric that is read from the service."""

    name: str
    """Name of the metric; a counter's without ``_total``."""
    text: str
    """Description."""
    labels: tuple[str, ...]
    """Names of the labels."""
    read: Callable[[Services], Labelled]
    """Returns the values."""
    counts: bool = False
    """Whether it is a counter; a counter of a live world starts again at its reset."""


class ServiceState(Collector):
    """Reads the state of a service.

    Args:
        services: The parts of the service.
    """

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
            "Time from the due time of a tick of a live world to its begin.",
            labels=("world",),
        )
        for world_id, world in self._services.worlds.copy().items():
            late = world.lateness
            family.add_metric((world_id,), late.buckets(), late.total_s)
        return family


def _family(one: StateMetric, values: Labelled) -> GaugeMetricFamily | CounterMetricFamily:
    kind = CounterMetricFamily if one.counts else GaugeMetricFamily
    family = kind(one.name, one.text, labels=one.labels)
    for labels, value in values:
        family.add_metric(labels, value)
    return family


def _of_worlds(
    value: Callable[[WorldSnapshot], float | None],
) -> Callable[[Services], Labelled]:
    def read(services: Services) -> Labelled:
        for world_id, world in services.worlds.copy().items():
            snapshot = world.handle.snapshot()
            if (found := value(snapshot)) is not None:
                yield (world_id, snapshot.cell), float(found)

    return read


def _stop_ratio(snapshot: WorldSnapshot) -> float | None:
    safety = snapshot.safety
    return safety.stopped_s / safety.moving_s if safety.moving_s > 0.0 else None


def _tracker_ages(services: Services) -> Labelled:
    for one in services.trackers.all():
        yield (one.id, one.cell), one.since_frame_s()


def _sockets(services: Services) -> Labelled:
    yield ("motion",), services.motion_load.n_open
    yield ("viewer",), MAX_VIEWERS - services.viewers._value


def _limits(_services: Services) -> Labelled:
    yield ("motion",), MAX_SOCKETS
    yield ("viewer",), MAX_VIEWERS


def _steps(services: Services) -> Labelled:
    for job in list_jobs(services.store, state="running").items:
        yield (job.id, job.kind, job.preset or ""), job.step


def _total_steps(services: Services) -> Labelled:
    for job in list_jobs(services.store, state="running").items:
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
        "Whether no job runs because the disk is full or the database takes no writes.",
        (),
        lambda services: [((), services.supervisor.waiting is not None)],
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
        "tandem_jobs",
        "Jobs by state.",
        ("state",),
        lambda services: (((state,), n) for state, n in count_jobs(services.store).items()),
    ),
    StateMetric("tandem_job_steps", "Steps done by a running job.", _JOB, _steps),
    StateMetric("tandem_job_total_steps", "Steps of a running job.", _JOB, _total_steps),
)
