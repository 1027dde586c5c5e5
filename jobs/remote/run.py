"""Entry point of a job's process: ``python -m jobs.remote.run --job ID --attempt N``.

It runs on any machine: the address of the service is in ``TANDEM_WORKER_URL``, its token in
``TANDEM_TOKEN``; the database is not accessed.
"""

import sys
from collections.abc import Mapping
from functools import partial

import torch

from app.settings import Settings, load_settings
from app.store.records import Claim
from jobs.access import JobAccess
from jobs.attempt import run_attempt
from jobs.remote.access import ServiceAccess
from jobs.remote.connection import ServiceConnection
from jobs.remote.inputs import ServiceInputs
from jobs.run import runners
from jobs.worker import Runner


def connect(settings: Settings, claim: Claim) -> tuple[JobAccess, Mapping[str, Runner]]:
    """Connect to the service for an attempt."""
    service = ServiceConnection(settings.worker_address, settings.secret, claim)
    return ServiceAccess(service), runners(ServiceInputs(service))


def main() -> int:
    """Run the attempt of the command line with the settings of the environment."""
    torch.set_num_threads(1)
    settings = load_settings()
    return run_attempt(partial(connect, settings), settings.log)


if __name__ == "__main__":
    sys.exit(main())
