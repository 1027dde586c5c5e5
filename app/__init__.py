"""Tandem: a robot arm and a person share a work cell; learned policies choose and move.

Matrix products for decisions run in one thread, and with the instructions the processor has:
OpenBLAS takes newer AMD processors for older ones. Both must be set before numpy is imported.
"""

import os
from pathlib import Path


def _prepare_matrix_library() -> None:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    described = Path("/proc/cpuinfo")
    processor = described.read_text(encoding="utf-8") if described.exists() else ""
    if "AuthenticAMD" in processor and "avx512f" in processor:
        os.environ.setdefault("OPENBLAS_CORETYPE", "SkylakeX")


_prepare_matrix_library()
