"""Kill campaign: ``python -m tests.jobs.kill_campaign FOLDER --kills 1000 --minutes 120``.

Kills, stops and terminates servers and workers at random moments, also during start, migration,
post and cancel, and checks after every SERIES kills that nothing acknowledged is lost. With
``--postgresql`` the jobs are in a PostgreSQL server of the campaign, which is also crashed. The
folder has the progress: the same command goes on after an interruption. Its file *report.json*
counts kills, jobs and their ends, *summary.json* is the result for the docs.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from contextlib import ExitStack, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import sqlalchemy as sa

from app.provenance import describe
from app.store import checkpoints, events, jobs, metrics
from app.store.engine import Store
from app.store.records import FINAL_STATES, JobRecord
from jobs.executor import PROJECT_ROOT
from tests.jobs.counting_worker import CHECKPOINT_EVERY, FACTOR, GRID, MODULUS
from tests.jobs.machinery import WAIT_S, is_running, process_state, worker_pids
from tests.support.postgresql_server import PostgresqlServer, postgresql_server

SERIES = 25
"""Kills of one database, below the number that ends a job."""
LONGEST_S = 1.0
"""Longest time from the start of a server, its readiness or the last kill to a kill [s]."""
NATURAL_END_S = 20.0
"""Longest time in which the kernel ends the workers of a killed server [s]."""
SHARE_IN_START = 0.25
"""Share of the servers that are killed before they are ready, wherever they are then."""
KILLS = {
    "SIGKILL server": 8,
    "SIGTERM server": 2,
    "SIGSTOP server, SIGKILL": 2,
    "SIGSTOP server, SIGCONT": 1,
    "SIGKILL worker": 2,
    "SIGTERM worker": 2,
    "SIGSTOP worker, SIGKILL server": 2,
}
"""Ways of killing, each with its weight."""
CRASH, CRASH_WEIGHT = "SIGQUIT database", 3
"""The crash of a PostgreSQL server, which recovers at its next start, and its weight."""
LONGEST_CRASH_S = 1.0
"""Longest time from a crash of the database to its next start [s]."""


@dataclass(slots=True)
class Series:
    """Jobs of one database, as its servers acknowledged them."""

    url: str
    folder: Path
    posted: dict[str, tuple[int, int]] = field(default_factory=dict)
    asked_to_cancel: set[str] = field(default_factory=set)
    continued: int = 0
    """Workers that were stopped before they asked to end with their server."""
    server: "subprocess.Popen[bytes] | None" = None
    database: PostgresqlServer | None = None
    """The server of the database, where it has one that the campaign may crash."""

    @property
    def kills(self) -> dict[str, int]:
        """Ways of killing in this series, each with its weight."""
        return KILLS if self.database is None else KILLS | {CRASH: CRASH_WEIGHT}

    def start(self, seed: int) -> "subprocess.Popen[bytes]":
        command = [sys.executable, "-m", "tests.jobs.campaign_server", self.url]
        with (self.folder / "server.log").open("a") as log, self.output.open("w") as output:
            self.server = subprocess.Popen(
                [*command, str(self.folder), str(seed)],
                cwd=PROJECT_ROOT,
                stdout=output,
                stderr=log,
            )
        return self.server

    @property
    def output(self) -> Path:
        """File of what the present server prints."""
        return self.folder / "server.jsonl"

    def wait_until_ready(self) -> None:
        """Wait for the first line of the server, or its end."""
        assert self.server is not None
        while self.server.poll() is None and "\n" not in self.output.read_text():
            time.sleep(0.01)

    def collect(self) -> None:
        """Wait for the end of the server and its workers; read what it acknowledged."""
        assert self.server is not None
        try:
            self.server.wait(timeout=WAIT_S)
        except subprocess.TimeoutExpired:
            self.server.send_signal(signal.SIGABRT)  # which prints where its threads are
            self.server.wait(timeout=NATURAL_END_S)
            log = (self.folder / "server.log").read_text()[-4000:]
            raise AssertionError(f"the server does not end: {log}") from None
        for line in self.output.read_text().splitlines():
            if not line.endswith("}"):
                continue  # cut off by the kill
            words = json.loads(line)
            if "posted" in words:
                self.posted[words["posted"]] = (words["seed"], words["steps"])
            self.asked_to_cancel |= {words.get("asked_to_cancel", "")}
        self.server = None


def kill(series: Series, how: str, chance: random.Random) -> bool:
    """Kill once; returns whether there was something to kill."""
    server = series.server
    assert server is not None
    workers = worker_pids(server.pid)
    if how == CRASH:
        assert series.database is not None
        series.database.stop(signal.SIGQUIT)
        time.sleep(chance.uniform(0.0, LONGEST_CRASH_S))
        series.database.start()
        return True
    if "worker" in how and not workers:
        return False
    first, _, then = how.partition(", ")
    name, target = first.split()
    _send(workers[0] if target == "worker" else server.pid, name)
    if then:
        time.sleep(chance.uniform(0.0, 0.5))
        _send(server.pid, then.split()[0])
    if then == "SIGCONT" or (target == "worker" and not then):
        return True
    series.collect()
    deadline = time.monotonic() + NATURAL_END_S
    if target == "worker" and process_state(workers[0]) == "T":
        # Stopped before it asked to end with its server: it ends as soon as it goes on.
        _send(workers[0], "SIGCONT")
        series.continued += 1
        deadline = time.monotonic() + WAIT_S
    while any(map(is_running, workers)):
        assert time.monotonic() < deadline, "a worker outlives its server"
        time.sleep(0.01)
    return True


def _send(pid: int, name: str) -> None:
    try:
        os.kill(pid, signal.Signals[name])
    except ProcessLookupError:
        pass  # it has just ended


def run_series(
    url: str,
    folder: Path,
    n_kills: int,
    seed: int,
    database: PostgresqlServer | None = None,
) -> dict[str, Any]:
    """Kill ``n_kills`` times, let the jobs end, and check them; returns the counts."""
    chance, kills = random.Random(seed), Counter[str]()
    series = Series(url, folder, database=database)
    try:
        while kills.total() < n_kills:
            if series.server is None or series.server.poll() is not None:
                if series.server is not None:
                    series.collect()
                series.start(chance.getrandbits(31))
                if chance.random() > SHARE_IN_START:
                    series.wait_until_ready()
            time.sleep(chance.uniform(0.0, LONGEST_S))
            (how,) = chance.choices(list(series.kills), list(series.kills.values()))
            kills[how] += kill(series, how, chance)
        if series.server is not None:
            _send(series.server.pid, "SIGTERM")
            series.collect()
        assert series.start(-1).wait(timeout=WAIT_S) == 0
        series.collect()
    finally:
        if series.server is not None:
            series.server.kill()
            series.server.wait()
    return {"kills": dict(kills), "continued": series.continued, **check(series)}


def check(series: Series) -> dict[str, Any]:
    """Check that nothing acknowledged is lost, and that every job ended once and whole."""
    store = Store(series.url)
    ends: Counter[str] = Counter()
    with store.reading() as connection:
        stored = set(connection.execute(sa.text("SELECT id FROM jobs")).scalars())
        if store.sqlite_path is not None:
            found = connection.execute(sa.text("PRAGMA integrity_check")).scalars().all()
            assert found == ["ok"], found
            assert not connection.execute(sa.text("PRAGMA foreign_key_check")).all()
    lost = series.posted.keys() - stored
    assert not lost, f"acknowledged jobs are lost: {lost}"
    for job_id in stored:
        job = jobs.get_job(store, job_id)
        news = events.list_events(store, job_id, limit=100_000)
        ended = [one for one in news if one.data.get("state") in FINAL_STATES]
        assert job.is_final and len(ended) == 1, (job, ended)
        assert ended[0] is news[-1] and news[-1].id == job.last_event
        if job.state == "succeeded":
            check_whole(store, job)
        elif job.state == "cancelled":
            assert job_id in series.asked_to_cancel, job
        else:
            assert job.error is not None and job.error.startswith("Failed after 3"), job
        ends[job.state] += 1
        ends["attempts"] += job.attempt
    assert all(error is None for error in checkpoints.find_damaged(store))
    store.close()
    return {"posted": len(series.posted), "jobs": len(stored), **ends}


def check_whole(store: Store, job: JobRecord) -> None:
    """Check the curve, the checkpoints and the result of a counting job.

    A worker that is terminated stores a checkpoint between those of the grid.
    """
    value, steps, expected = 1 + job.seed, job.overrides["steps"], {}
    for step in range(1, steps + 1):
        value = value * FACTOR % MODULUS
        expected[step] = value
    curve = {row.step: row.values["value"] for row in metrics.list_metrics(store, job.id)}
    assert curve == {step: expected[step] for step in range(GRID, steps + 1, GRID)}
    made = checkpoints.list_checkpoints(store, job_id=job.id, limit=200).items
    stored = {one.step: one.sha256 for one in made}
    assert len(stored) == len(made) and max(stored) == steps
    assert stored.keys() >= set(range(CHECKPOINT_EVERY, steps + 1, CHECKPOINT_EVERY))
    for step, sha256 in stored.items():
        assert step is not None
        assert checkpoints.read_checkpoint(store, sha256)[1] == expected[step].to_bytes(
            8, "big"
        )
    assert job.result == {"value": value}


def campaign(
    folder: Path, n_kills: int, minutes: float, database: PostgresqlServer | None = None
) -> dict[str, Any]:
    """Run series until there were ``n_kills`` kills or the time is over; returns the report.

    Args:
        folder: Folder of the progress.
        n_kills: Number of kills.
        minutes: Time after which no series begins [min].
        database: Server of the databases; None: SQLite.
    """
    progress = folder / "report.json"
    folder.mkdir(parents=True, exist_ok=True)
    done: dict[str, Any] = {"series": 0, "kills": {}, "seconds": 0.0}
    if progress.exists():
        done = json.loads(progress.read_text())
    deadline = time.monotonic() + 60.0 * minutes
    while (left := n_kills - sum(done["kills"].values())) > 0 and time.monotonic() < deadline:
        started, number = time.monotonic(), int(done["series"])
        here = folder / f"series-{number}-{os.getpid()}"
        here.mkdir()
        with ExitStack() as stack:
            url = f"sqlite:///{here}/tandem.db"
            if database is not None:
                url = stack.enter_context(database.database("template0"))
            found = run_series(url, here, min(left, SERIES), number, database)
        done["kills"] = dict(Counter(done["kills"]) + Counter(found.pop("kills")))
        for name, count in found.items():
            done[name] = done.get(name, 0) + count
        done["series"] = number + 1
        done["seconds"] = round(done["seconds"] + time.monotonic() - started, 1)
        part = progress.with_suffix(".part")
        part.write_text(json.dumps(done, indent=1))
        part.replace(progress)
        print(json.dumps(done), flush=True)
    return done


def summary(done: dict[str, Any], name: str, option: str) -> dict[str, Any]:
    """Return the counts as a result for ``tools.docs.tables``."""
    counts = ("posted", "jobs", "succeeded", "failed", "cancelled", "attempts", "continued")
    kills = done["kills"]
    row = {"name": name, "kills": sum(kills.values()), "series": done["series"]}
    return {
        "command": f"python -m tests.jobs.kill_campaign FOLDER{option}",
        "settings": {"kills": kills, "seconds": done["seconds"]},
        "results": [row | {name: done.get(name, 0) for name in counts}],
        "machine": describe(),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--kills", type=int, default=1000)
    parser.add_argument("--minutes", type=float, default=120.0)
    parser.add_argument("--postgresql", action="store_true")
    options = parser.parse_args()
    name, option = ("postgresql", " --postgresql") if options.postgresql else ("sqlite", "")
    with postgresql_server() if options.postgresql else nullcontext() as database:
        done = campaign(options.folder, options.kills, options.minutes, database)
    written = json.dumps(summary(done, name, option))
    (options.folder / "summary.json").write_text(written)


if __name__ == "__main__":
    main()
