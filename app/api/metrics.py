"""Metrics for Prometheus that are counted at requests; ``state_metrics`` reads the others.

Every application has its own registry. ``docs/operations.md`` lists the metrics.
"""

import platform
from collections.abc import Sequence

from prometheus_client import (
    CollectorRegistry,
    Counter,
    GCCollector,
    Histogram,
    Info,
    PlatformCollector,
    ProcessCollector,
)
from prometheus_client.registry import Collector

from app.provenance import describe

BUCKETS_S = (
    *(0.0001, 0.0002, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05),
    *(0.1, 0.2, 0.5, 1.0, 2.0, 5.0),
)
"""Upper bounds of the durations of requests [s]."""
METHODS = frozenset(("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "MESSAGE"))
DECISIONS = ("/v1/motion", "/v1/plan", "/v1/sorting", "/v1/task-selection")
"""Endpoints whose decisions outside the training range are counted."""
UNROUTED = "none"
"""Endpoint of a request that no route answers: refused before, or unknown."""


class Metrics:
    """Metrics that are counted while requests are answered; safe to use from any thread."""

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
        for endpoint in DECISIONS:  # from 0 on: Prometheus sees no increase to a first value
            self._outside.labels(endpoint)
        self._waits = Histogram(
            "tandem_socket_wait_seconds",
            "Time from the arrival of a message on a motion socket to its decision.",
            buckets=BUCKETS_S,
            registry=self.registry,
        )
        self._missed = Counter(
            "tandem_socket_deadlines_missed",
            "Answers on motion sockets after their deadline.",
            registry=self.registry,
        )
        self._superseded = Counter(
            "tandem_socket_messages_superseded",
            "Messages on motion sockets that were not answered because a newer one arrived.",
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
        self._state: Collector | None = None
        self._children: dict[tuple[str, str, int], Histogram] = {}

    def observe(self, method: str, endpoint: str, status: int, seconds: float) -> None:
        """Count an answer.

        Args:
            method: HTTP method, or ``MESSAGE`` for a message on a socket.
            endpoint: Path of the route, with its parameters' names.
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

    def count_message(
        self,
        endpoint: str,
        status: int,
        wait_s: float,
        total_s: float,
        *,
        missed: bool,
        left: int,
    ) -> None:
        """Count an answer on a socket.

        Args:
            status: Status of the answer, as of the route.
            wait_s: Time from the arrival of the message to the start of the decision [s].
            total_s: Time from the arrival to the answer [s].
            missed: Whether the answer missed its deadline.
            left: Older messages that were not answered.
        """
        self.observe("MESSAGE", endpoint, status, total_s)
        self._waits.observe(wait_s)
        if missed:
            self._missed.inc()
        if left:
            self._superseded.inc(left)

    def watch(self, state: Collector) -> None:
        """Read the state of a service at each scrape, in place of one before."""
        if self._state is not None:
            self.registry.unregister(self._state)
        self._state = state
        self.registry.register(state)
