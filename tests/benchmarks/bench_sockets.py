"""Motion sockets at 50 Hz: time of an answer and missed deadlines, for 1 to 20 sockets.

    python -m app bench sockets [--json]

The service runs in a process of its own. Each socket sends a request every 20 ms, at its own
phase, whether the one before was answered or not; states and people are those met by a robot
that moves at random (rollouts on). The value is the share of requests that were not answered
within 20 ms after they were due. ``admitted`` is the number of sockets that the service
admitted; the others send nothing. The rows ``...-training`` are measured beside a training job.

Clock time at the client: median, 99th and 99.9th percentile of the answers.
"""

import argparse
import asyncio
import itertools
import json
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import uvloop
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from tests.benchmarks.http_servers import service, start_training
from tests.benchmarks.measure import Row, arguments, quantiles_ms, report, row_of
from tests.benchmarks.motion_decisions import requests

BENCH = "sockets"
SOCKETS = (1, 2, 4, 8, 12, 16, 20)
PERIOD_S = 0.02
PAUSE_S = 1.0
"""Time after a run, in which its load is forgotten [s]."""
LAST_ANSWER_S = 0.5
"""Time for the last answers of a run [s]."""


@dataclass(slots=True)
class Loops:
    """Outcome of a run; filled by its sockets."""

    admitted: int = 0
    """Number of sockets that the service admitted."""
    sent: int = 0
    """Number of requests."""
    superseded: int = 0
    """Number of requests that were not answered because of a newer one."""
    shortened: int = 0
    """Number of answers without search or rollout."""
    times_ms: list[float] = field(default_factory=list)
    """Time from when a request was due to its answer [ms]."""

    def missed_percent(self) -> float:
        """Return the share of requests that were not answered in time [%]."""
        in_time = sum(one <= 1e3 * PERIOD_S for one in self.times_ms)
        return 100.0 * (1.0 - in_time / self.sent) if self.sent else 100.0


async def run(address: str, states: Sequence[str], sockets: int, seconds: float) -> Loops:
    """Return the answers to a number of sockets.

    Args:
        address: Address of the service.
        states: Requests without their last brace.
        sockets: Number of sockets.
        seconds: Time for which they send [s].
    """
    found, url = Loops(), f"{address.replace('http', 'ws', 1)}/v1/motion/stream"
    opened = [await connect(url, compression=None) for _ in range(sockets)]
    begin = time.perf_counter() + 0.1
    phases = [begin + PERIOD_S * k / sockets for k in range(sockets)]
    ends = begin + seconds
    try:
        loops = zip(opened, phases, strict=True)
        await asyncio.gather(*(_loop(one, states, at, ends, found) for one, at in loops))
    finally:
        await asyncio.gather(*(one.close() for one in opened))
    await asyncio.sleep(PAUSE_S)
    return found


async def _loop(
    socket: ClientConnection, states: Sequence[str], begin: float, ends: float, found: Loops
) -> None:
    """Send requests at 50 Hz; the stamp of a request is the time at which it was due."""
    reader = asyncio.create_task(_read(socket, found))
    turn = itertools.cycle(states)
    due, admitted = begin, False
    try:
        while due < ends:
            await asyncio.sleep(max(0.0, due - time.perf_counter()))
            await socket.send(f'{next(turn)}, "stamp": {due!r}}}')
            found.admitted += not admitted
            admitted = True
            found.sent += 1
            due += PERIOD_S
        await asyncio.sleep(LAST_ANSWER_S)
    except ConnectionClosed as error:
        if error.rcvd is None or error.rcvd.code != 1013:
            raise
    finally:
        reader.cancel()


async def _read(socket: ClientConnection, found: Loops) -> None:
    async for text in socket:
        now, answer = time.perf_counter(), json.loads(text)
        found.times_ms.append(1e3 * (now - answer["stamp"]))
        found.superseded += answer["stream"]["superseded"]
        found.shortened += bool(answer["stream"]["left_out"])


def rows_of(
    address: str, states: Sequence[str], beside: str, options: argparse.Namespace
) -> Iterator[Row]:
    """Yield a row for each number of sockets.

    Args:
        address: Address of the service.
        states: Requests without their last brace.
        beside: Suffix of the names of the rows.
        options: Rounds and seconds.
    """
    for sockets in SOCKETS:
        found = [
            uvloop.run(run(address, states, sockets, options.seconds))
            for _ in range(options.rounds)
        ]
        times = np.concatenate([one.times_ms for one in found])
        sent = sum(one.sent for one in found)
        yield row_of(
            f"sockets-{sockets}{beside}",
            [one.missed_percent() for one in found],
            "% missed",
            admitted=min(one.admitted for one in found),
            **quantiles_ms(times),
            superseded_percent=100.0 * sum(one.superseded for one in found) / sent,
            shortened_percent=100.0 * sum(one.shortened for one in found) / sent,
            n=sent,
        )


def main() -> None:
    """Measure and print."""
    options = arguments(BENCH, rounds=3, seconds=5.0)
    states = [json.dumps(one)[:-1] for one in requests(options.seed)]
    with tempfile.TemporaryDirectory(prefix="tandem-bench-") as folder:
        with service(Path(folder)) as address:
            rows = list(rows_of(address, states, "", options))
            start_training(address)
            rows += rows_of(address, states, "-training", options)
    shown = ("admitted", "superseded_percent", "shortened_percent")
    report(BENCH, rows, options, shown)


if __name__ == "__main__":
    main()
