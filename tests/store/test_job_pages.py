"""A page of jobs costs the same however many jobs there are."""

from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any

import pytest
import sqlalchemy as sa

from app.store import jobs
from app.store.cursors import encode_cursor
from app.store.database.tables import jobs as table
from app.store.engine import Store
from app.store.records import JobState
from tests.support.databases import POSTGRESQL_ONLY, SQLITE_ONLY

STATES = ("succeeded", "failed", "cancelled", "queued", "running")


def add(store: Store, first: int, last: int) -> None:
    """Add jobs in all states in turn, one in 50 of them unfinished."""
    row = {
        "kind": "count",
        "seed": 0,
        "overrides": {},
        "spec": {},
        "created_at": datetime.now(UTC),
    }
    with store.writing() as connection:
        rows = [
            {**row, "id": f"{k:036}", "state": STATES[k % 3 if k % 50 else 3 + k // 50 % 2]}
            for k in range(first, last)
        ]
        connection.execute(sa.insert(table), rows)


def asked(store: Store, call: Callable[[], object]) -> list[tuple[str, Any]]:
    """Return the queries of a call with their parameters."""
    found: list[tuple[str, Any]] = []

    def note(*event: Any) -> None:
        if event[2].startswith("SELECT"):
            found.append((event[2], event[3]))

    sa.event.listen(store.engine, "before_cursor_execute", note)
    try:
        call()
    finally:
        sa.event.remove(store.engine, "before_cursor_execute", note)
    return found


def plan(store: Store, query: str, parameters: Any) -> str:
    with store.reading() as connection:
        rows = connection.exec_driver_sql(f"EXPLAIN QUERY PLAN {query}", parameters)
        return "; ".join(row.detail for row in rows)


def database_steps(store: Store, call: Callable[[], object]) -> int:
    """Return the instructions that SQLite executes in a call."""
    steps = 0

    def count() -> None:
        nonlocal steps
        steps += 1

    def watch(*event: Any) -> None:
        event[0].connection.driver_connection.set_progress_handler(count, 1)

    sa.event.listen(store.engine, "before_cursor_execute", watch)
    try:
        call()
    finally:
        sa.event.remove(store.engine, "before_cursor_execute", watch)
    return steps


def rows_read(store: Store, call: Callable[[], object]) -> int:
    """Return the rows that PostgreSQL reads in a call, those it then leaves out included."""
    ((query, parameters),) = asked(store, call)
    with store.reading() as connection:
        explain = f"EXPLAIN (ANALYZE, FORMAT JSON) {query}"
        (found,) = connection.exec_driver_sql(explain, parameters).scalar_one()
    return _rows_of(found["Plan"])


def _rows_of(node: dict[str, Any]) -> int:
    rows = node["Actual Rows"] + node.get("Rows Removed by Filter", 0)
    return rows * node["Actual Loops"] + sum(_rows_of(one) for one in node.get("Plans", []))


@SQLITE_ONLY
@pytest.mark.parametrize(
    ("state", "cursor", "expected"),
    [
        (None, False, "SCAN jobs"),  # by number, backward, until the page is full
        (None, True, "SEARCH jobs USING INTEGER PRIMARY KEY (rowid<?)"),
        ("failed", False, "SEARCH jobs USING INDEX ix_jobs_state_number (state=?)"),
        ("failed", True, "SEARCH jobs USING INDEX ix_jobs_state_number (state=? AND number<?)"),
        ("running", False, "SEARCH jobs USING INDEX ix_jobs_state_number (state=?)"),
        ("cancelling", False, "SEARCH jobs USING INDEX ix_jobs_state_number (state=?)"),
    ],
)
def test_a_page_is_read_by_an_index_without_sorting(
    store: Store, state: JobState | None, cursor: bool, expected: str
) -> None:
    add(store, 0, 300)
    below = encode_cursor(200) if cursor else None
    ((query, parameters),) = asked(
        store, lambda: jobs.list_jobs(store, state=state, cursor=below)
    )
    assert plan(store, query, parameters) == expected


@SQLITE_ONLY
@pytest.mark.parametrize("part_of", ["none", f"{7:036}"])
def test_pages_of_parts_and_without_them_are_read_by_an_index(
    store: Store, part_of: str
) -> None:
    add(store, 0, 300)
    ((query, parameters),) = asked(store, lambda: jobs.list_jobs(store, part_of=part_of))
    expected = "SEARCH jobs USING INDEX ix_jobs_part_of_number (part_of=?)"
    assert plan(store, query, parameters) == expected


@SQLITE_ONLY
@pytest.mark.parametrize("column", ["kind", "preset"])
def test_pages_of_a_kind_or_preset_are_read_by_an_index(store: Store, column: str) -> None:
    add(store, 0, 300)
    filters: dict[str, Any] = {column: "other"}
    ((query, parameters),) = asked(store, lambda: jobs.list_jobs(store, **filters))
    expected = f"SEARCH jobs USING INDEX ix_jobs_{column}_number ({column}=?)"
    assert plan(store, query, parameters) == expected


@SQLITE_ONLY
@pytest.mark.parametrize("state", [None, *STATES])
def test_a_page_costs_the_same_among_ten_times_as_many_jobs(
    store: Store, state: JobState | None
) -> None:
    def page() -> None:
        jobs.list_jobs(store, state=state, limit=3)

    add(store, 0, 1000)
    few = database_steps(store, page)
    add(store, 1000, 10_000)
    assert 0 < database_steps(store, page) <= 1.1 * few


@POSTGRESQL_ONLY
@pytest.mark.parametrize("state", [None, *STATES])
def test_postgresql_reads_no_more_rows_for_a_page_among_ten_times_as_many_jobs(
    store: Store, state: JobState | None
) -> None:
    def page() -> None:
        jobs.list_jobs(store, state=state, limit=3)

    def statistics() -> None:
        with store.writing() as connection:
            connection.exec_driver_sql("ANALYZE jobs")

    add(store, 0, 1000)
    statistics()
    few = rows_read(store, page)
    add(store, 1000, 10_000)
    statistics()
    assert 0 < rows_read(store, page) <= few
