"""Task selection and motion of a robot arm beside people, by reinforcement learning.

Importing the package sets two variables of OpenBLAS, before numpy is imported: matrix products
of decisions use one thread, and the instruction set of the processor, which OpenBLAS detects
wrongly on newer AMD processors.
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
