"""A process that does what the server does for jobs, and nothing else, until it is killed."""

import sys
import threading
from pathlib import Path

from app.store.engine import Store
from jobs.executor import LocalProcess
from jobs.supervisor import Supervisor, Timeouts

COUNTING = "tests.jobs.counting_worker"


def main(data_dir: Path) -> None:
    store = Store(f"sqlite:///{data_dir}/tandem.db")
    executor = LocalProcess(store.url, data_dir, COUNTING)
    supervisor = Supervisor(store, data_dir, executor=executor, timeouts=Timeouts(tick_s=0.05))
    supervisor.start()
    print("ready", flush=True)
    threading.Event().wait()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
