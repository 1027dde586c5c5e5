"""Kernels compiled with an entry for Python, and as parts of other kernels."""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

from app.sim.core.jit import kernel

MODULE = """
from app.sim.core.jit import kernel

@kernel()
def share(a, b):
    return a / b

@kernel()
def first(a, b):
    return share(a, b) + 1.0

@kernel()
def second(a, b):
    return share(a, b) + 2.0
"""


@kernel()
def share(a: float, b: float) -> float:
    return a / b


@kernel(inline="always")
def clipped(x: float) -> float:
    if x < 0.0:
        return 0.0
    return x if x < 1.0 else 1.0


@kernel()
def clipped_shares(a: float, b: float) -> float:
    total = 0.0
    for i in range(3):
        total += clipped(share(a, b) - i) + clipped(clipped(b))
    return total


def test_kernel_that_only_kernels_call_has_no_entry() -> None:
    assert clipped_shares(3.0, 2.0) == 1.0 + 0.5 + 3.0
    assert not share.signatures
    assert share(3.0, 2.0) == 1.5
    assert len(share.signatures) == 1


def test_inlined_kernel_gives_what_its_function_gives() -> None:
    for a, b in ((5.0, 2.0), (-1.0, 0.5), (0.2, -4.0)):
        expected = sum(
            clipped.py_func(a / b - i) + clipped.py_func(clipped.py_func(b)) for i in range(3)
        )
        assert clipped_shares(a, b) == expected


@kernel()
def sums_over_branches(rows: tuple[float, ...], n: int, low: float) -> tuple[float, float]:
    total, last = 0.0, 0.0
    scale = rows[0] * 2.0  # assigned once, used in all branches and after the loop
    for i in range(n):
        now = rows[i % 3] + scale
        if now < low:
            kept = now  # assigned once, used in this branch
            total -= 0.5 * kept
        else:
            last = now
            total += last * scale
    return total + scale, last


def test_variables_keep_their_values_over_branches_and_rounds() -> None:
    for rows in ((1.0, -4.0, 2.5), (-1.0, 3.0, 0.5)):
        for n in (3, 6):
            expected = sums_over_branches.py_func(rows, n, -1.0)
            assert sums_over_branches(rows, n, -1.0) == expected


def test_error_of_a_kernel_passes_through_its_caller() -> None:
    with pytest.raises(ZeroDivisionError):
        clipped_shares(1.0, 0.0)


def test_kernel_is_pickled_by_reference_to_itself() -> None:
    assert pickle.loads(pickle.dumps(share)) is share


def test_part_compiled_by_one_process_is_read_by_the_next(tmp_path: Path) -> None:
    (tmp_path / "parts.py").write_text(MODULE)
    paths = os.pathsep.join((str(tmp_path), str(Path(__file__).parents[3])))
    env = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": paths}

    def value_of(call: str) -> str:
        command = [sys.executable, "-c", f"import parts; print(parts.{call})"]
        return subprocess.run(
            command, env=env, capture_output=True, text=True, check=True
        ).stdout.strip()

    assert value_of("first(3.0, 2.0)") == "2.5"
    (part,) = (tmp_path / "cache").rglob("*share*-callee.1.nbc")
    written = part.stat().st_mtime_ns
    assert value_of("second(3.0, 2.0)") == "3.5"
    assert value_of("first(1.0, 2.0)") == "1.5"
    assert part.stat().st_mtime_ns == written
