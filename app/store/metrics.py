"""Learning curves of jobs: one row per step."""

from collections.abc import Mapping
from typing import Any

import sqlalchemy as sa

from app.errors import NotFound
from app.store.database.tables import jobs
from app.store.database.tables import metrics as table
from app.store.engine import Store
from app.store.records import MetricRow

MAX_POINTS = 10_000
"""Largest number of points of a thinned curve."""


def list_metrics(
    store: Store, job_id: str, *, after_step: int = -1, limit: int = 10_000
) -> tuple[MetricRow, ...]:
    """Return the points of a job's curve beyond ``after_step``, in order of steps.

    Raises:
        NotFound: There is no such job.
    """
    query = (
        sa.select(table)
        .where(table.c.job_id == job_id, table.c.step > after_step)
        .order_by(table.c.step)
        .limit(limit)
    )
    with store.reading() as connection:
        known = connection.execute(sa.select(jobs.c.id).where(jobs.c.id == job_id)).first()
        if known is None:
            raise NotFound("job", job_id)
        rows = connection.execute(query).mappings().all()
    return tuple(_point(row) for row in rows)


def thinned_curve(store: Store, job_id: str) -> tuple[MetricRow, ...]:
    """Return a job's curve in order of steps.

    Of more than ``MAX_POINTS`` points it has the last one and, from there, every n-th.
    """
    mine = table.c.job_id == job_id
    place = sa.func.row_number().over(order_by=table.c.step.desc()) - 1
    places = sa.select(table.c.step, place.label("place")).where(mine).subquery()
    n_points = sa.select(sa.func.count()).select_from(table).where(mine)
    with store.reading() as connection:
        every = every_nth(connection.execute(n_points).scalar_one())
        kept = sa.select(places.c.step).where(places.c.place % every == 0)
        query = sa.select(table).where(mine, table.c.step.in_(kept)).order_by(table.c.step)
        rows = connection.execute(query).mappings().all()
    return tuple(_point(row) for row in rows)


def every_nth(n_points: int) -> int:
    """Return n so that every n-th of some points are at most ``MAX_POINTS``."""
    return max(1, -(-n_points // MAX_POINTS))


def newest_point(store: Store, job_id: str) -> MetricRow | None:
    """Return the last point of a job's curve; None without one."""
    query = sa.select(table).where(table.c.job_id == job_id)
    with store.reading() as connection:
        found = connection.execute(query.order_by(table.c.step.desc()).limit(1))
        row = found.mappings().first()
    return None if row is None else _point(row)


def _point(row: Mapping[Any, Any]) -> MetricRow:
    return MetricRow(step=row["step"], values=row["values"], at=row["at"])
