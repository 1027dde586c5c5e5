from pathlib import Path

import pytest

from tests.jobs.kill_campaign import campaign, run_series
from tests.support.postgresql_server import PostgresqlServer


def test_nothing_acknowledged_is_lost_in_thirty_kills(tmp_path: Path) -> None:
    report = campaign(tmp_path, 30, minutes=60.0)
    assert sum(report["kills"].values()) == 30
    assert report["jobs"] >= report["posted"] > 0
    again = campaign(tmp_path, 30, minutes=60.0)
    assert again == report


@pytest.mark.postgres
def test_nothing_acknowledged_is_lost_in_thirty_kills_on_postgresql(
    postgresql: PostgresqlServer, tmp_path: Path
) -> None:
    with postgresql.database("template0") as url:
        report = run_series(url, tmp_path, 30, seed=0, database=postgresql)
    assert sum(report["kills"].values()) == 30
    assert report["jobs"] >= report["posted"] > 0
