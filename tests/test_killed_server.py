"""A server killed with SIGKILL in the middle of a training loses nothing it acknowledged."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx

from tests.support import patient_http

ROOT = Path(__file__).parents[1]
PATIENCE_S = 300.0
"""Longest wait for anything on a busy machine [s]."""
TRAINING = {
    "kind": "train",
    "preset": "pick-td3",
    "seed": 5,
    "overrides": {
        "learning": {
            "total_steps": 4096,
            "n_envs": 16,
            "buffer_size": 2000,
            "batch_size": 64,
            "learning_starts": 256,
            "progress_steps": 256,
            "checkpoint_steps": 512,
        },
        "networks": {"width": 64},
    },
}


@contextmanager
def serving(data: Path) -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    env = os.environ | {"TANDEM_DATA": str(data), "TANDEM_PORT": str(port)}
    with (data / "server.log").open("ab") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "app", "serve"], cwd=ROOT, env=env, stdout=log, stderr=log
        )
    try:
        yield process, f"http://127.0.0.1:{port}"
    finally:
        process.kill()
        process.wait()


def wait_for(what: Callable[[], Any]) -> Any:
    give_up = time.monotonic() + PATIENCE_S
    while time.monotonic() < give_up:
        try:
            if answer := what():
                return answer
        except httpx.TransportError:
            pass
        time.sleep(0.1)
    raise AssertionError("waited in vain")


def test_training_finishes_without_gap_after_the_server_was_killed(tmp_path: Path) -> None:
    with serving(tmp_path) as (process, address):
        wait_for(lambda: patient_http.get(f"{address}/v1/jobs").status_code == 200)
        posted = patient_http.post(f"{address}/v1/jobs", json=TRAINING)
        assert posted.status_code == 202
        path = posted.headers["location"]
        wait_for(lambda: patient_http.get(f"{address}{path}").json()["step"] >= 1024)
        process.send_signal(signal.SIGKILL)
        process.wait()
    with serving(tmp_path) as (_, address):
        ended = ("succeeded", "failed", "cancelled")

        def settled() -> Any:
            job = patient_http.get(f"{address}{path}").json()
            return job if job["state"] in ended else None

        job = wait_for(settled)
        assert (job["state"], job["attempt"]) == ("succeeded", 2), job
        curve = patient_http.get(f"{address}{path}/metrics", params={"limit": 1000}).json()
        steps = [point["step"] for point in curve["items"]]
        assert steps == list(range(256, 4096 + 1, 256))
        kept = patient_http.get(f"{address}/v1/checkpoints", params={"limit": 100})
        stored = kept.json()["items"]
        mine = [row["step"] for row in stored if row.get("job_id") == job["id"]]
        assert sorted(mine) == list(range(512, 4096 + 1, 512))
