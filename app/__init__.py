"""Task selection and motion of a robot arm beside people, by reinforcement learning.

Importing the package sets two variables of OpenBLAS, before numpy is imported: matrix products
of decisions use one thread, and the instruction set of the processor, which OpenBLAS detects
wrongly on newer AMD processors.

__main__          ``python -m app``: the command line
digests           SHA-256 of stored data: canonical JSON followed by bytes
durable_files     Files that exist wholly or not at all, also after a power failure
errors            The error hierarchy
logs              Log lines of server and workers: readable text or one JSON object per line
main              Composition root: creates the parts of the service
one_line          Text of one line, such as names and titles from outside
precompile        Compilation of all kernels into the cache on disk
provenance        Version of Tandem; machine, versions and commit of a measurement
settings          Settings of the service: the ``TANDEM_*`` environment variables
state_dict        State of objects as named arrays and JSON values, to resume trainings exactly
storage_errors    Errors of the database and its disk
temporary_folder  Temporary folders of processes; those of killed processes are removed by later
                  ones
traces            Traces for OpenTelemetry
unused_kernels    Removal of compiled kernels that earlier versions have left in the data folder
api/              HTTP and WebSocket: application, access control, problems, routes, schemas
cli/              The command line
client/           Python client of a running server
live/             Live worlds: a work cell that runs in real time, takes commands and gives
                  snapshots
policies/         Policies: training, inference and evaluation
sim/              The simulator
store/            The database: jobs, curves, events, checkpoints; the only package with SQL
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
