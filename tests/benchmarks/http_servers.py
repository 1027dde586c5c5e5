"""Servers that the benchmarks of HTTP and sockets measure, each in its own process.

Run as a script, this is the peer: FastAPI on uvicorn with one route, without any layer of ours.
"""

import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import uvicorn
from fastapi import FastAPI
from pydantic import BaseModel

from app.settings import PREFIX

ROOT = Path(__file__).parents[2]
START_S = 900.0
"""Longest start, with every kernel to compile [s]."""
TRAINING = {"kind": "train", "preset": "pick-td3", "seed": 1}
"""The job beside which is measured."""


class Task(BaseModel):
    """A small body."""

    id: str
    position: list[float]


async def choose(task: Task) -> Task:
    """Return the body."""
    return task


def bare_app() -> FastAPI:
    """Return the application of the peer."""
    app = FastAPI()
    app.post("/")(choose)
    return app


@contextmanager
def bare_route() -> Iterator[str]:
    """Run the peer; yields its address."""
    with _process(sys.executable, str(Path(__file__))) as address:
        _wait(f"{address}/openapi.json")
        yield address


@contextmanager
def service(data: Path) -> Iterator[str]:
    """Run the service with a data folder; yields its address once it can decide."""
    command = (sys.executable, "-m", "app", "serve", "--port", "0", "--data", str(data))
    with _process(*command) as address:
        _wait(f"{address}/readyz")
        yield address


def start_training(address: str) -> None:
    """Start a training job of the service and wait for its first steps."""
    job = httpx.post(f"{address}/v1/jobs", json=TRAINING).raise_for_status()
    url = f"{address}{job.headers['location']}"
    ends = time.monotonic() + START_S
    while not (found := httpx.get(url, timeout=60.0).json())["step"]:
        if time.monotonic() > ends or found["error"]:
            raise RuntimeError(f"the training does not run: {found}")
        time.sleep(1.0)


@contextmanager
def _process(*command: str) -> Iterator[str]:
    """Run a server with default settings that prints its address; yields the address."""
    own = {name: value for name, value in os.environ.items() if not name.startswith(PREFIX)}
    environment = {**own, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"}
    with tempfile.TemporaryFile() as log:
        process = subprocess.Popen(command, cwd=ROOT, env=environment, stdout=log, stderr=log)
        try:
            yield _address(process, log.fileno())
        finally:
            process.terminate()
            process.wait(60.0)


def _address(process: subprocess.Popen[bytes], log: int) -> str:
    ends = time.monotonic() + START_S
    while time.monotonic() < ends:
        text = os.pread(log, 1 << 16, 0).decode()
        if found := re.search(r"http://127\.0\.0\.1:\d+", text):
            return found[0]
        if process.poll() is not None:
            break
        time.sleep(0.1)
    raise RuntimeError(f"the server did not start: {text}")


def _wait(url: str) -> None:
    ends = time.monotonic() + START_S
    while time.monotonic() < ends:
        try:
            if httpx.get(url, timeout=60.0).status_code == 200:
                return
        except httpx.TransportError:
            pass
        time.sleep(0.2)
    raise RuntimeError(f"{url} is not ready after {START_S:.0f} s")


if __name__ == "__main__":
    uvicorn.run(bare_app(), port=0, access_log=False)
