"""A process that does what the server does for jobs, and nothing else, until it is killed."""

import sys
import threading
from pathlib import Path

from app.store.engine import Store
from jobs.executor import LocalExecutor
from jobs.supervisor import Supervisor
from jobs.timeouts import Timeouts

COUNTING = "tests.jobs.counting_worker"


def main(database_url: str, data_dir: Path, lease_s: float) -> None:
    store = Store(database_url)
    executor = LocalExecutor(store.url, data_dir, COUNTING)
    timeouts = Timeouts(tick_s=0.05, lease_s=lease_s)
    supervisor = Supervisor(store, data_dir, executor=executor, timeouts=timeouts)
    supervisor.start()
    print("ready", flush=True)
    threading.Event().wait()


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), float(sys.argv[3]))
