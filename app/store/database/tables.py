"""The tables. Migrations in ``app/store/migrations`` build exactly these (a test compares).

Every table of a job refers to ``jobs.id``. ``jobs.last_event`` numbers the events of a job: the
UPDATE that fences a write increments it, so that ids follow the order of commits.
"""

import logging
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import (
    JSON,
    BigInteger,
    Boolean,
    Column,
    DateTime,
    Dialect,
    Float,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    MetaData,
    String,
    Table,
    Text,
    TypeDecorator,
    UniqueConstraint,
)

logger = logging.getLogger(__name__)

metadata = MetaData(
    naming_convention={
        "ix": "ix_%(column_0_label)s",
        "uq": "uq_%(table_name)s_%(column_0_name)s",
        "fk": "fk_%(table_name)s_%(column_0_name)s_%(referred_table_name)s",
        "pk": "pk_%(table_name)s",
    }
)


class UtcDateTime(TypeDecorator[datetime]):
    """Aware UTC times in Python, naive UTC in the database."""

    impl = DateTime
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """Convert to UTC and drop the zone."""
        return None if value is None else value.astimezone(UTC).replace(tzinfo=None)

    def result_processor(self, dialect: Dialect, coltype: object) -> Any:
        """Read a damaged time as year 1, so that other rows can be read."""
        read = super().result_processor(dialect, coltype)

        def process(value: Any) -> Any:
            try:
                return value if read is None else read(value)
            except (TypeError, ValueError):
                logger.error("a time in the database is damaged: %.40r", value)
                return datetime.min.replace(tzinfo=UTC)

        return process

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        """Add the zone."""
        return None if value is None else value.replace(tzinfo=UTC)


def _job_key() -> Column[str]:
    target = ForeignKey("jobs.id", ondelete="CASCADE")
    return Column("job_id", String(36), target, primary_key=True)


jobs = Table(
    "jobs",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("id", String(36), nullable=False, unique=True),
    Column("kind", String(32), nullable=False),
    Column("preset", String(64)),
    Column("seed", BigInteger, nullable=False),
    Column("overrides", JSON, nullable=False),
    Column("spec", JSON, nullable=False),
    Column("name", String(80)),
    Column("notes", Text),
    Column("parent", String(36)),  # no foreign key: it may be deleted
    Column("priority", Integer, nullable=False, default=0, server_default="0"),
    Column("state", String(16), nullable=False),
    Column("attempt", Integer, nullable=False, default=0),
    Column("failures", Integer, nullable=False, default=0),
    Column("created_at", UtcDateTime, nullable=False),
    Column("started_at", UtcDateTime),
    Column("finished_at", UtcDateTime),
    Column("heartbeat_at", UtcDateTime),
    Column("error", Text),
    Column("step", BigInteger, nullable=False, default=0),
    Column("total_steps", BigInteger),
    Column("cancel_requested", Boolean, nullable=False, default=False),
    Column("idempotency_key", String(255), unique=True),
    Column("result", JSON(none_as_null=True)),
    Column("last_event", Integer, nullable=False, default=0),
    Column("kills", Integer, nullable=False, server_default="0"),
    Column("waiting", String(64)),
    Column("step_budget", BigInteger),
    Column("time_budget_s", Float),
    Column("run_s", Float, nullable=False, server_default="0"),
    Column("ended_by", String(16)),
    Column("part_of", String(36)),  # no foreign key, as for the parent
    Column("trial", Integer),
    Column("checkpoint", String(64)),
    Column("end_number", Integer),
    Column("submission_digest", String(64)),
    Index("ix_jobs_state_number", "state", "number"),  # pages of jobs in a state
    Index("ix_jobs_part_of_number", "part_of", "number"),  # pages without parts, or of them
    Index("ix_jobs_kind_number", "kind", "number"),  # pages of jobs of a kind
    Index("ix_jobs_preset_number", "preset", "number"),  # pages of jobs of a preset
    Index("ix_jobs_end_number", "end_number"),  # the last one, and the ended jobs in order
    sqlite_autoincrement=True,
)

metrics = Table(
    "metrics",
    metadata,
    _job_key(),
    Column("step", BigInteger, primary_key=True, autoincrement=False),
    Column("values", JSON, nullable=False),
    Column("at", UtcDateTime, nullable=False),
)

events = Table(
    "events",
    metadata,
    _job_key(),
    Column("id", Integer, primary_key=True, autoincrement=False),
    Column("kind", String(16), nullable=False),
    Column("step", BigInteger),
    Column("data", JSON, nullable=False),
    Column("at", UtcDateTime, nullable=False),
)

checkpoints = Table(
    "checkpoints",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("sha256", String(64), nullable=False, unique=True),
    Column("imported", Boolean, nullable=False),
    Column("manifest", JSON, nullable=False),
    Column("size", Integer, nullable=False),
    Column("created_at", UtcDateTime, nullable=False),
    Column("tensors", LargeBinary, nullable=False),
    sqlite_autoincrement=True,
)

job_checkpoints = Table(
    "job_checkpoints",
    metadata,
    _job_key(),
    Column("step", BigInteger, primary_key=True, autoincrement=False),
    Column("sha256", String(64), ForeignKey("checkpoints.sha256"), nullable=False),
    Index("ix_job_checkpoints_sha256", "sha256"),
)

resume_states = Table(
    "resume_states",
    metadata,
    _job_key(),
    Column("step", BigInteger, primary_key=True, autoincrement=False),
    Column("manifest", JSON, nullable=False),
    Column("digest", String(64)),
    Column("tensors", LargeBinary, nullable=False),
)
"""The newest two of each job, against damage to one."""

aliases = Table(
    "aliases",
    metadata,
    Column("name", String(64), primary_key=True),
    Column("sha256", String(64), ForeignKey("checkpoints.sha256"), nullable=False),
    Column("set_at", UtcDateTime, nullable=False),
)

cells = Table(
    "cells",
    metadata,
    Column("name", String(64), primary_key=True),
    Column("definition", JSON, nullable=False),
    Column("digest", String(64)),
    Column("created_at", UtcDateTime, nullable=False),
)

recordings = Table(
    "recordings",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=True),
    Column("name", String(64), nullable=False),
    Column("sha256", String(64), nullable=False),
    Column("file_name", String(255), nullable=False),
    Column("n_runs", Integer, nullable=False),
    Column("n_frames", Integer, nullable=False),
    Column("duration", Float, nullable=False),
    Column("summary", JSON, nullable=False),
    Column("detail", JSON, nullable=False),
    Column("size", Integer, nullable=False),
    Column("created_at", UtcDateTime, nullable=False),
    Column("summary_digest", String(64)),
    Column("digest", String(64)),
    Column("tensors", LargeBinary, nullable=False),
    UniqueConstraint("name", name="uq_motions_name"),  # the table's name before migration 0005
    sqlite_autoincrement=True,
)

leases = Table(
    "leases",
    metadata,
    Column("name", String(32), primary_key=True),
    Column("owner", String(255), nullable=False),
    Column("place", String(255), nullable=False),
    Column("token", String(36), nullable=False),
    Column("epoch", BigInteger, nullable=False),
    Column("expires_at", UtcDateTime, nullable=False),
)
"""One row: the server that runs the jobs (``app.store.database.lease``)."""

reserve = Table(
    "reserve",
    metadata,
    Column("id", Integer, primary_key=True, autoincrement=False),
    Column("filler", LargeBinary, nullable=False),
)
"""Space that is freed in a full database, so that jobs can be ended or cancelled."""
