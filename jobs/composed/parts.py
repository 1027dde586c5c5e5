"""Queueing of the parts of a composed job."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from app.store.engine import Store
from app.store.jobs import create_job
from app.store.records import JobRecord
from jobs.spec import parse_spec


def queue_part(
    store: Store, whole: JobRecord, number: int, name: str, key: str, body: Mapping[str, Any]
) -> None:
    """Queue a trial or evaluation; once, however often this is repeated, with any priority."""
    new = parse_spec(body).new_job()
    new = replace(new, name=name, priority=whole.priority, part_of=whole.id, trial=number)
    create_job(store, new, idempotency_key=key, submitted=new.spec)
