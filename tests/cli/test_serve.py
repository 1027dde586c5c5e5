"""Starts of the server that fail, and its version."""

import os
import sys
from pathlib import Path

import pytest
import sqlalchemy as sa

from app.cli.entry import main
from app.cli.serve import print_start
from app.provenance import VERSION
from app.store.database.migrate import migrate
from app.store.engine import Store
from tests.cli.test_commands import run


@pytest.mark.parametrize(
    ("setting", "status", "reason"),
    [({"TANDEM_RAY": "lab:6379"}, 2, "TANDEM_WORKER_URL"), ({}, 1, "schema 9999")],
)
def test_start_that_fails_ends_with_the_status_of_its_reason(
    tmp_path: Path, setting: dict[str, str], status: int, reason: str
) -> None:
    store = Store(f"sqlite:///{tmp_path}/tandem.db")
    migrate(store)
    with store.writing() as connection:
        connection.execute(sa.text("UPDATE alembic_version SET version_num = '9999'"))
    ended = run("serve", data=tmp_path, TANDEM_PORT="0", **setting)
    assert (ended.returncode, "Traceback" in ended.stderr) == (status, False)
    assert reason in ended.stderr


def test_start_goes_on_where_nothing_reads_the_output(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    with open(writing, "w") as output:
        monkeypatch.setattr(sys, "stdout", output)
        print_start("Tandem starts")
        print_start("Tandem is ready")
    assert caplog.messages == ["standard output takes no lines: Broken pipe"]


def test_version_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith(f"Tandem {VERSION}")
