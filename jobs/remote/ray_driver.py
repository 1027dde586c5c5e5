"""One attempt on a Ray cluster: ``python -m jobs.remote.ray_driver --job ID --attempt N``.

Runs on the machine of the server in place of a local worker, so that the supervisor starts,
watches and stops both alike, and no failure of Ray reaches the server. It starts a process on a
free CPU of a node (``jobs.remote.ray_node``), copies its output, passes SIGTERM on, and ends
with its exit status. Ray ends that process when this one is killed. Until the process has
started, a cluster that fails queues the job again; afterwards it counts as a crash. A process
that SIGTERM ended, as when the node's machine shuts down, is queued again.
"""

import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import asdict
from typing import Any

import ray
from ray.exceptions import ActorUnavailableError, RayActorError, RayError

from app import logs
from app.errors import ServiceError
from app.provenance import describe
from app.settings import Settings, load_settings
from app.storage_errors import StaleAttempt, StorageFull, StorageUnavailable
from app.store import attempts
from app.store.engine import Store
from app.store.records import Claim
from jobs.attempt import claim_of_arguments
from jobs.executor import NO_CLUSTER, NO_CPU, Exit
from jobs.remote.ray_node import NodeWorker

logger = logging.getLogger(__name__)

POLL_S = 0.25
"""Period of the polls [s]."""
PATIENCE_S = 10.0
"""Time until a job that finds no cluster or no free CPU says so [s]."""
HEARTBEAT_S = 5.0
"""Period of heartbeats until the process has started [s]."""


class RayDriver:
    """Runs one attempt, with the settings of the server."""

    def __init__(self, settings: Settings, claim: Claim) -> None:
        self._settings, self._claim = settings, claim
        self._stopped = False  # no event: a signal handler must not wait for its lock
        self._has_started = False

    def stop(self, *_: object) -> None:
        """Stop the attempt at its next step."""
        self._stopped = True

    def run(self) -> int:
        """Run the attempt; return the exit status of its process.

        ``EX_TEMPFAIL``, which queues the job again, where it was stopped or the cluster failed
        before the process had started.
        """
        try:
            with self._waiting_for(NO_CLUSTER):
                ray.init(
                    address=self._settings.ray,
                    log_to_driver=False,
                    logging_level=logging.ERROR,
                )
            signal.signal(signal.SIGTERM, self.stop)
            return self._run()
        except (RayError, ConnectionError) as error:
            logger.error("the Ray cluster or the node of the worker has failed: %s", error)
            # A process that cannot be started on a node may never be.
            broken = isinstance(error, RayActorError) and error.actor_init_failed
            return os.EX_UNAVAILABLE if self._has_started or broken else os.EX_TEMPFAIL

    def _run(self) -> int:
        given = {"TANDEM_WORKER_URL": self._settings.worker_address}
        if self._settings.secret is not None:
            given["TANDEM_TOKEN"] = self._settings.secret
        actor = ray.remote(num_cpus=1, max_restarts=0)(NodeWorker)
        node = actor.remote(self._claim, given)
        if not self._wait_for_start(node):
            return os.EX_TEMPFAIL
        self._has_started = True
        return self._watch(node)

    @contextmanager
    def _waiting_for(self, reason: str) -> Iterator[None]:
        """Record heartbeats with a reason while the block lasts, after ``PATIENCE_S``."""
        ended = threading.Event()
        beat = threading.Thread(target=self._beat, args=(reason, ended), daemon=True)
        beat.start()
        try:
            yield
        finally:
            ended.set()
            beat.join()

    def _beat(self, reason: str, ended: threading.Event) -> None:
        pause = PATIENCE_S
        with closing(Store(self._settings.database)) as store:
            while not ended.wait(pause):
                pause = HEARTBEAT_S
                try:
                    attempts.heartbeat(store, self._claim, reason)
                except (StorageFull, StorageUnavailable):
                    pass  # the next one may be recorded
                except StaleAttempt as error:
                    logger.warning("%s", error)
                    self._stopped = True
                    return

    def _wait_for_start(self, node: Any) -> bool:
        """Return whether the process has started; False: it was stopped before."""
        found = node.about.remote()
        with self._waiting_for(NO_CPU):
            while not ray.wait([found], timeout=POLL_S)[0]:
                if self._stopped:
                    return False
        name, commit = ray.get(found)
        logger.info("runs on node %s", name)
        if commit != (own := describe()["commit"]):
            text = "node %s runs commit %s of this program, the server %s"
            logger.warning(text, name, commit, own)
        return True

    def _watch(self, node: Any) -> int:
        """Copy the output and pass a stop on, until the process has ended."""
        sent = False
        while True:
            with suppress(ActorUnavailableError):  # it may answer again
                output, code = ray.get(node.poll.remote())
                copy_output(output)
                if code is not None:
                    return exit_status(code)
            if self._stopped and not sent:
                node.stop.remote()
                sent = True
            time.sleep(POLL_S)


def exit_status(code: int) -> int:
    """Return the exit status of an attempt by that of its process on a node.

    ``EX_TEMPFAIL``, which queues the job again, where SIGTERM ended it (a negative ``code``).
    """
    if code >= 0:
        return code
    logger.error("%s", Exit(code=code, tail="").reason)
    return os.EX_TEMPFAIL if code == -signal.SIGTERM else os.EX_SOFTWARE


def main() -> int:
    """Run the attempt of the command line; return its exit status."""
    claim = claim_of_arguments("Run one attempt of a job on a Ray cluster.")
    settings = load_settings()
    logs.set_up(settings.log, **asdict(claim))
    try:
        return RayDriver(settings, claim).run()
    except ServiceError as error:
        logger.error("%s", error.message)
        return os.EX_CONFIG


def copy_output(output: bytes) -> None:
    """Append to the output of this process, without a buffer; nothing on a full disk."""
    with suppress(OSError):
        os.write(sys.stdout.fileno(), output)


if __name__ == "__main__":
    sys.exit(main())
