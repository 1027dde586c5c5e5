"""Entry point of a job's process: ``python -m jobs.remote.run --job ID --attempt N``.

It runs on any machine: the address of the service is in ``TANDEM_WORKER_URL``, its token in
``TANDEM_TOKEN``; the database is not accessed.
"""

import sys

from app.settings import Settings
from app.store.records import Claim
from jobs import run
from jobs.attempt import Connected
from jobs.remote.access import ServiceAccess
from jobs.remote.connection import ServiceConnection
from jobs.remote.inputs import ServiceInputs


def connect(settings: Settings, claim: Claim) -> Connected:
    """Connect to the service for an attempt."""
    service = ServiceConnection(settings.worker_address, settings.secret, claim)
    return ServiceAccess(service), run.runners(ServiceInputs(service))


def main() -> int:
    """Run the attempt of the command line with the settings of the environment."""
    return run.main(connect)


if __name__ == "__main__":
    sys.exit(main())
