"""The command ``train``: it continues an interrupted training, and refuses another one."""

import json
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from app.cli.entry import main
from app.cli.train import INTERRUPTED, cut_curve
from tests.cli.test_commands import ROOT, environment

FIELDS = {
    "learning.total_steps": 4096,
    "learning.n_envs": 8,
    "learning.buffer_size": 2000,
    "learning.batch_size": 16,
    "learning.learning_starts": 128,
    "learning.progress_steps": 64,
    "learning.checkpoint_steps": 512,
    "networks.width": 16,
}
STEPS = list(range(64, 4097, 64))


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
            if f"{step} of 4096 steps" in line:
                process.send_signal(signal.SIGINT)
    return process.returncode, "".join(lines)


def steps_of(output: Path) -> Sequence[int]:
    lines = (output / "curve.jsonl").read_text().splitlines()
    return [json.loads(line)["step"] for line in lines]


def test_interrupted_command_continues_with_the_same_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("TANDEM_DATA", str(tmp_path))
    parts, whole = tmp_path / "parts", tmp_path / "whole"
    status, messages = interrupted(parts, tmp_path, 640)
    assert status == INTERRUPTED, messages
    assert f"the same command continues from {parts}" in messages
    assert any((parts / "resume").glob("step-*.json"))
    for change, field in (
        (["--seed", "1"], "seed = 1 differs from 0"),
        (["--set", "learning.gamma=0.9"], "learning.gamma = 0.9 differs from 0.995"),
    ):
        assert main(call(parts, *change)) == 2
        assert field in capsys.readouterr().err
    assert main(call(parts)) == 0
    assert "continues at step" in capsys.readouterr().err
    assert main(call(whole)) == 0
    for name in ("policy.safetensors", "policy.json"):
        assert (parts / name).read_bytes() == (whole / name).read_bytes()
    assert steps_of(parts) == steps_of(whole) == STEPS
    assert not (parts / "resume").exists()


def test_points_beyond_a_state_and_a_torn_line_are_deleted(tmp_path: Path) -> None:
    path = tmp_path / "curve.jsonl"
    cut_curve(path, 10)
    assert not path.exists()
    path.write_text('{"step": 5}\n{"step": 10}\n{"step": 15}\n{"step": 2')
    cut_curve(path, 10)
    assert path.read_text() == '{"step": 5}\n{"step": 10}\n'
