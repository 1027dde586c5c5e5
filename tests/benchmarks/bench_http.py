"""Decisions over HTTP: time of an answer and answers per second, for 1 and 100 clients.

    python -m app bench http [--json]

The service runs in a process of its own. Its peer, a bare FastAPI route that returns its small
body, is measured in alternation with every row: ``times_bare`` is the ratio of their answers
per second. The rows ``...-training`` are measured beside a training job of the service.
``task-selection`` chooses among 3 candidates beside a person in joint angles (``-keypoints``:
in key-points, which are fitted first), ``motion`` has a rollout (``motion-alone`` none),
``risk-map`` has 3 x 2 positions, ``jobs`` lists 50 of 2,000 jobs.

Clock time at the client: median, 99th and 99.9th percentile over all rounds.
"""

import argparse
import tempfile
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import sqlalchemy as sa

from app.api.schemas import examples
from app.sim.human import model as human
from app.store.database.migrate import migrate
from app.store.database.tables import jobs
from app.store.engine import Store
from tests.benchmarks.http_load import Load, Request, load
from tests.benchmarks.http_servers import bare_route, service, start_training
from tests.benchmarks.measure import Row, arguments, quantiles_ms, report, row_of

BENCH = "http"
CLIENTS = (1, 100)
N_JOBS = 2000
THREE = [
    *examples.TASK_SELECTION["candidates"],
    {"id": "middle", "position": [-0.1, 0.75, 0.12]},
]
PEOPLE = [{"q": human.rest_posture(0.0, 1.45, -1.57).tolist(), "qd": [0.0] * 18}]
"""A person in joint angles; the examples have key-points, which take a fit."""
SORTING = {name: examples.PLAN[name] for name in ("cell", "objects", "goal")}
REQUESTS = {
    "task-selection": Request(
        path="/v1/task-selection",
        body={**examples.TASK_SELECTION, "candidates": THREE, "people": PEOPLE},
    ),
    "task-selection-keypoints": Request(
        path="/v1/task-selection", body={**examples.TASK_SELECTION, "candidates": THREE}
    ),
    "motion": Request(path="/v1/motion", body=examples.MOTION),
    "motion-alone": Request(path="/v1/motion", body={**examples.MOTION, "rollout": False}),
    "plan": Request(path="/v1/plan", body={**examples.PLAN, "people": PEOPLE}),
    "risk-map": Request(path="/v1/risk-map", body={**examples.RISK_MAP, "people": PEOPLE}),
    "sorting": Request(path="/v1/sorting", body=SORTING),
    "jobs": Request(path="/v1/jobs"),
}
BARE = Request(path="/", body=THREE[0])


def add_finished_jobs(data: Path) -> None:
    """Make a database with finished jobs in a data folder."""
    store, now = Store(f"sqlite:///{data / 'tandem.db'}"), datetime.now(UTC)
    migrate(store)
    row = {
        "kind": "train", "preset": "pick-td3", "seed": 1, "overrides": {}, "spec": {},
        "state": "succeeded", "created_at": now, "finished_at": now,
    }  # fmt: skip
    with store.writing() as connection:
        rows = [{**row, "id": f"{k:036}"} for k in range(N_JOBS)]
        connection.execute(sa.insert(jobs), rows)
    store.close()


def rows_of(ours: str, bare: str, beside: str, options: argparse.Namespace) -> Iterator[Row]:
    """Yield the rows of all endpoints.

    Args:
        ours: Address of the service.
        bare: Address of its peer.
        beside: Suffix of the names of the rows.
        options: Rounds and seconds.
    """
    seconds: float = options.seconds
    for clients in CLIENTS:
        peers: list[Load] = []
        for name, request in REQUESTS.items():
            load(ours, request, clients=clients, seconds=0.2)  # warm-up
            found: list[Load] = []
            for _ in range(options.rounds):
                peers.append(load(bare, BARE, clients=clients, seconds=seconds))
                found.append(load(ours, request, clients=clients, seconds=seconds))
            ratios = [
                peer.per_second / one.per_second
                for peer, one in zip(peers[-options.rounds :], found, strict=True)
            ]
            yield row(f"{name}-{clients}{beside}", clients, found, float(np.median(ratios)))
        yield row(f"bare-{clients}{beside}", clients, peers, 1.0)


def row(name: str, clients: int, found: list[Load], times_bare: float) -> Row:
    """Return the row of an endpoint."""
    times = np.concatenate([one.times_ms for one in found])
    values = [one.per_second for one in found]
    more = {**quantiles_ms(times), "n": len(times), "times_bare": times_bare}
    return row_of(name, values, "answers/s", clients=clients, **more)


def main() -> None:
    """Measure and print."""
    options = arguments(BENCH)
    with tempfile.TemporaryDirectory(prefix="tandem-bench-") as folder:
        add_finished_jobs(Path(folder))
        with service(Path(folder)) as ours, bare_route() as bare:
            rows = list(rows_of(ours, bare, "", options))
            start_training(ours)
            rows += rows_of(ours, bare, "-training", options)
    report(BENCH, rows, options, ("times_bare",), jobs=N_JOBS)


if __name__ == "__main__":
    main()
