"""The command ``train``: it continues an interrupted training, and refuses another one."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from app.cli.entry import main
from app.cli.train import INTERRUPTED, cut_curve, in_use
from tests.cli.test_commands import ROOT, environment

FIELDS = {
    "learning.total_steps": 1024,
    "learning.n_envs": 8,
    "learning.buffer_size": 2000,
    "learning.batch_size": 16,
    "learning.learning_starts": 128,
    "learning.progress_steps": 64,
    "learning.checkpoint_steps": 256,
    "networks.width": 16,
}
STEPS = list(range(64, 1025, 64))


def call(output: Path, *more: str) -> list[str]:
    sets = [part for name, value in FIELDS.items() for part in ("--set", f"{name}={value}")]
    return ["train", "pick-td3", "--output", str(output), *sets, *more]


def interrupted(output: Path, data: Path, step: int) -> tuple[int, str]:
    """Start the command and press Ctrl-C after a step; return exit status and messages."""
    command = [sys.executable, "-m", "app", *call(output)]
    lines: list[str] = []
    with subprocess.Popen(
        command, cwd=ROOT, env=environment(data), stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        for line in process.stderr:
            lines.append(line)
            if f"{step} of 1024 steps" in line:
                process.send_signal(signal.SIGINT)
    return process.returncode, "".join(lines)


def steps_of(output: Path) -> Sequence[int]:
    lines = (output / "curve.jsonl").read_text().splitlines()
    return [json.loads(line)["step"] for line in lines]


def test_interrupted_command_continues_with_the_same_result(
    tmp_path: Path, data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    parts, whole = tmp_path / "parts", tmp_path / "whole"
    status, messages = interrupted(parts, data, 320)
    assert status == INTERRUPTED, messages
    assert f"the same command continues from {parts}" in messages
    assert any((parts / "resume").glob("step-*.json"))
    for change, field in (
        (["--seed", "1"], "seed = 1 differs from 0"),
        (["--set", "learning.gamma=0.9"], "learning.gamma = 0.9 differs from 0.995"),
    ):
        assert main(call(parts, *change)) == 2
        assert field in capsys.readouterr().err
    before = (parts / "policy.safetensors").read_bytes()
    with (parts / "policy.safetensors").open("rb") as reader:
        assert main(call(parts)) == 0
        assert reader.read() == before
    assert "continues at step" in capsys.readouterr().err
    assert main(call(whole)) == 0
    for name in ("policy.safetensors", "policy.json"):
        assert (parts / name).read_bytes() == (whole / name).read_bytes()
    assert steps_of(parts) == steps_of(whole) == STEPS
    assert not (parts / "resume").exists()


HOLDER = "import sys, time; from pathlib import Path; from app.cli.train import in_use\n\
with in_use(Path(sys.argv[1])): print('held', flush=True); time.sleep(600)"


def test_second_training_in_a_folder_is_refused_until_the_first_is_killed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "run"
    command = [sys.executable, "-c", HOLDER, str(folder)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as first:
        assert first.stdout is not None and first.stdout.readline() == "held\n"
        assert main(call(folder)) == 2
        refused = capsys.readouterr().err
        assert f"--output = '{folder}' must not be used by another training" in refused
        assert f"(process {first.pid})" in refused
        assert not (folder / "curve.jsonl").exists()
        first.kill()
    with in_use(folder):
        assert (folder / "train.lock").read_text() == str(os.getpid())


def test_folder_that_cannot_be_made_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    assert main(call(tmp_path / "file")) == 2
    assert "--output" in capsys.readouterr().err


def test_points_beyond_a_state_and_a_torn_line_are_deleted(tmp_path: Path) -> None:
    path = tmp_path / "curve.jsonl"
    cut_curve(path, 10)
    assert not path.exists()
    path.write_text('{"step": 5}\n{"step": 10}\n{"step": 15}\n{"step": 2')
    cut_curve(path, 10)
    assert path.read_text() == '{"step": 5}\n{"step": 10}\n'
