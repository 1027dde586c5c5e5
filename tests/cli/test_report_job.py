"""The report that a running server measures; the test ends its evaluations."""

import json
import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from app.__main__ import main
from app.cli import report_job
from app.main import publish_shipped
from app.policies.report.page import evaluations
from app.store import jobs
from app.store.database.migrate import migrate
from app.store.engine import Store
from tests.jobs.composed.test_reports import look, post, run_one
from tests.jobs.remote.serving import TOKEN, serving
from tests.support.waiting import wait_until


@pytest.fixture
def store(data: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Store]:
    """The database of a running server without a supervisor, which the command finds."""
    url = f"sqlite:///{data.parent / 'tandem.db'}"
    with closing(Store(url)) as found:
        migrate(found)
        with serving(found, data.parent) as (address, services):
            publish_shipped(services.checkpoints)
            monkeypatch.setenv("TANDEM_PORT", address.rpartition(":")[2])
            monkeypatch.setenv("TANDEM_TOKEN", TOKEN)
            monkeypatch.setattr(report_job, "POLL_S", 0.01)
            yield found


class Command:
    """The command, running beside the test."""

    def __init__(self, page: Path) -> None:
        self.status: int | None = None
        self._arguments = ["report", "--episodes", "7", "--output", str(page), "--json"]
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        self.status = main(self._arguments)

    def join(self) -> None:
        self._thread.join(60.0)


def test_the_command_measures_as_a_job_and_goes_on_with_it_when_repeated(
    store: Store, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "report.md"
    command = Command(page)
    wait_until(lambda: jobs.list_jobs(store).items)
    (report,) = jobs.list_jobs(store).items
    assert report.spec["measure"] and report.spec["episodes"] == 7
    look(store, report)
    jobs.request_cancel(store, report.id)
    wait_until(lambda: look(store, report).state == "cancelled")
    command.join()
    assert command.status == 1 and not page.exists()
    said = capsys.readouterr().err
    assert "job 1 is cancelled; the same command resumes it" in said

    command = Command(page)
    wait_until(lambda: look(store, report).state == "running")
    while look(store, report).state == "running":
        run_one(store)
    command.join()
    assert command.status == 0
    assert "12.34 % (10.00-20.00)" in page.read_text(encoding="utf-8")
    out, said = capsys.readouterr()
    assert json.loads(out)["failed"] == []
    assert f"0 of {len(evaluations())} evaluations" in said
    assert len(jobs.list_jobs(store, part_of=jobs.NO_PARTS).items) == 1


def test_a_job_that_ended_without_the_command_is_delivered_once(
    store: Store, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "report.md"
    page.write_text("an older page", encoding="utf-8")
    posted = post(store, measure=True, episodes=7)
    look(store, posted)
    while look(store, posted).state == "running":
        run_one(store)
    command = Command(page)
    command.join()
    assert command.status == 0
    assert "12.34 % (10.00-20.00)" in page.read_text(encoding="utf-8")
    assert "job 1 of" in (said := capsys.readouterr().err) and "has measured" in said

    command = Command(page)  # its page is written: a new job
    wait_until(lambda: len(jobs.list_jobs(store, part_of=jobs.NO_PARTS).items) == 2)
    newest = jobs.list_jobs(store, part_of=jobs.NO_PARTS).items[0]
    jobs.request_cancel(store, newest.id)
    wait_until(lambda: look(store, newest).state == "cancelled")
    command.join()
    assert command.status == 1


def test_without_a_server_the_command_says_what_to_do(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as free:
        port = free.getsockname()[1]
    monkeypatch.setenv("TANDEM_PORT", str(port))
    assert main(["report", "--output", str(tmp_path / "report.md")]) == 1
    said = capsys.readouterr().err
    assert f"no server answers at http://127.0.0.1:{port}" in said and "--quick" in said


def test_another_token_is_refused(
    store: Store,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("TANDEM_TOKEN", TOKEN[::-1])
    assert main(["report", "--output", str(tmp_path / "report.md")]) == 1
    assert "refused: 401" in capsys.readouterr().err
    assert not jobs.list_jobs(store).items


def test_the_missing_client_is_named(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "httpx", None)
    for name in ("app.cli.report_job", "app.client", "app.client.transport"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    assert main(["report", "--output", str(tmp_path / "report.md")]) == 1
    assert "needs the package 'httpx'" in capsys.readouterr().err
