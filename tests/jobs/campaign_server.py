"""A server of counting jobs that posts and cancels them itself, until it is killed.

Prints a JSON line before and after each post and cancel: what was acknowledged is known even
if the process is killed in between.
"""

import faulthandler
import json
import random
import signal
import sys
import time
from pathlib import Path
from types import FrameType

from app.errors import ServiceError
from app.store import jobs
from app.store.engine import Store
from app.store.records import NewJob
from jobs.executor import LocalExecutor
from jobs.supervisor import Supervisor
from jobs.timeouts import Timeouts
from tests.jobs.supervisor_process import COUNTING

MAX_ACTIVE = 4
"""Jobs that are queued or running at once."""


def say(**words: object) -> None:
    print(json.dumps(words), flush=True)


def post_one(store: Store, chance: random.Random) -> None:
    seed, steps = chance.randrange(1000), chance.randrange(20, 200)
    body = {"kind": "count", "seed": seed, "overrides": {"steps": steps}}
    key = str(chance.getrandbits(64))
    new = NewJob(kind="count", seed=seed, overrides={"steps": steps}, spec=body)
    job = jobs.create_job(store, new, idempotency_key=key)
    say(posted=job.id, seed=seed, steps=steps)


def cancel_one(store: Store, chance: random.Random) -> None:
    job = chance.choice(jobs.list_jobs(store).items)
    if not job.is_final:
        say(asked_to_cancel=job.id)
        jobs.request_cancel(store, job.id)
        say(cancelled=job.id)


def main(url: str, data_dir: Path, seed: int) -> None:
    """Serve; post and cancel jobs where ``seed`` is not negative, otherwise only end them."""
    chance, over = random.Random(seed), False

    def stop(_signal: int, _frame: FrameType | None) -> None:
        nonlocal over  # no event, whose lock the interrupted thread may hold
        over = True

    faulthandler.enable()
    signal.signal(signal.SIGTERM, stop)
    store = Store(url)
    executor = LocalExecutor(store.url, data_dir, COUNTING)
    timeouts = Timeouts(tick_s=0.05, cancel_s=5.0, retry_s=0.2)
    supervisor = Supervisor(store, data_dir, executor=executor, timeouts=timeouts)
    supervisor.start()
    say(ready=True)
    while not over:
        time.sleep(chance.uniform(0.01, 0.2))
        try:
            active = [job for job in jobs.list_jobs(store).items if not job.is_final]
            if seed < 0:
                if not active:
                    break
            elif len(active) < MAX_ACTIVE:
                post_one(store, chance)
            elif chance.random() < 0.1:
                cancel_one(store, chance)
        except ServiceError:
            continue  # the job has ended meanwhile, or the database is restarted
        supervisor.wake()
    supervisor.stop()
    store.close()


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]))
