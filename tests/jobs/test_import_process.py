import sys
import threading

import pytest

from app.errors import BadRecording, InvalidInput, NotReady, SimulationError
from app.sim.mocap.read_options import ReadOptions
from jobs import import_process
from jobs.import_process import ImportProcess, import_here
from tests.sim.recorded_person import bvh_text, csv_text, working
from tests.support.waiting import wait_until

CLIP = csv_text(working(100)).encode()
ASKED = ("nod.csv", "nod", "a" * 64)


def test_process_of_its_own_finds_the_same_as_this_one() -> None:
    assert ImportProcess()(CLIP, *ASKED) == import_here(CLIP, *ASKED)


def test_what_is_stated_about_a_file_goes_to_the_process() -> None:
    clip, options = bvh_text(working(100)).encode(), ReadOptions(unit="0.0011", up="y")
    asked = ("nod.bvh", "nod", "a" * 64, options)
    found = ImportProcess()(clip, *asked)
    assert found == import_here(clip, *asked)
    assert found.summary["body_m"]["forearm_r"] == pytest.approx(0.286)


def test_faults_come_back_whole() -> None:
    with pytest.raises(BadRecording) as here:
        import_here(CLIP[:-3000], "动 作.bvh", "nod", "a" * 64)
    with pytest.raises(BadRecording) as apart:
        ImportProcess()(CLIP[:-3000], "动 作.bvh", "nod", "a" * 64)
    assert apart.value.faults == here.value.faults


def test_import_that_takes_too_long_is_ended_and_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(import_process, "MAX_IMPORT_S", 0.05)
    with pytest.raises(InvalidInput, match=r"takes more than 0\.05 s to import"):
        ImportProcess()(CLIP, *ASKED)


LIMITED = """
import sys
import time
from jobs import import_process
import_process.MAX_CPU_S, import_process.MAX_MEMORY_BYTES = int(sys.argv[1]), int(sys.argv[2])
while time.process_time() < float(sys.argv[3]):
    pass
import_process.main()
"""


@pytest.mark.parametrize(
    ("cpu_s", "memory", "spent_s", "error", "text"),
    [
        (100, 1 << 24, 0.0, BadRecording, "takes more than 16 MiB of memory to import"),
        (2, 1 << 30, 1.98, InvalidInput, r"takes more than 120 s of processor time .*cut it"),
    ],
)
def test_import_beyond_a_limit_is_ended_and_named(
    monkeypatch: pytest.MonkeyPatch,
    cpu_s: int,
    memory: int,
    spent_s: float,
    error: type[InvalidInput],
    text: str,
) -> None:
    command = (sys.executable, "-c", LIMITED, *map(str, (cpu_s, memory, spent_s)))
    monkeypatch.setattr(import_process, "child_command", lambda _module: command)
    clip = csv_text(working(20_000)).encode()
    with pytest.raises(error, match=text):
        ImportProcess()(clip, *ASKED)


def test_process_that_dies_is_reported_and_its_output_is_logged(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("PYTHONHOME", "/nowhere")  # no interpreter starts from there
    with pytest.raises(SimulationError, match=r"'nod\.csv' ended without an answer"):
        ImportProcess()(CLIP, *ASKED)
    assert "encodings" in caplog.text


def test_stopping_ends_what_runs_and_refuses_more() -> None:
    imports = ImportProcess()
    raised: list[BaseException] = []

    def ask() -> None:
        try:
            imports(CLIP, *ASKED)
        except NotReady as error:
            raised.append(error)

    thread = threading.Thread(target=ask)
    thread.start()
    wait_until(lambda: imports._running)
    imports.stop()
    thread.join(timeout=30.0)
    assert not thread.is_alive() and len(raised) == 1
    with pytest.raises(NotReady):
        imports(CLIP, *ASKED)
