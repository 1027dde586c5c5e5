"""The commands ``serve`` and ``setup``."""

import logging
import os
import sys
import time
from contextlib import closing
from typing import Annotated

import typer

from app.cli.options import check_kernels_kept, prepared_settings

logger = logging.getLogger(__name__)


def serve(
    host: Annotated[
        str | None, typer.Option(help="Address to listen on (TANDEM_HOST).")
    ] = None,
    port: Annotated[int | None, typer.Option(help="Port (TANDEM_PORT).")] = None,
    data: Annotated[str | None, typer.Option(help="Data folder (TANDEM_DATA).")] = None,
) -> None:
    """Start the service."""
    from app.cli.preflight import check_database_unused, listen
    from app.settings import check_access

    settings = prepared_settings(host=host, port=port, data=data)
    check_access(settings)
    sock = listen(settings.host, settings.port)
    check_database_unused(settings)
    check_kernels_kept(settings)

    from app.cli.uvicorn_server import run

    run(settings, sock, report=print_start)


def print_start(line: str) -> None:
    """Print a line about the start; the service goes on where standard output takes none."""
    try:
        print(line, flush=True)
    except OSError as error:  # as after `serve | head -1`
        logger.warning("standard output takes no lines: %s", error.strerror)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def setup() -> None:
    """Create or upgrade the database and compile the kernels."""
    settings = prepared_settings()
    from app.cli.database import upgrade
    from app.precompile import PARTS, compile_all
    from app.provenance import cores
    from app.settings import make_data_folder
    from app.store.engine import Store

    make_data_folder(settings)
    with closing(Store(settings.database)) as store:
        upgrade(store, settings)
        print(f"database: {store.shown_url}", flush=True)
    check_kernels_kept(settings)
    print("compiling the simulator's kernels (several minutes, once) ...", flush=True)
    started = time.monotonic()
    for n, (name, cpu_s) in enumerate(compile_all(cores()), 1):
        print(f"    {n} of {len(PARTS)}: {name} ({cpu_s:.0f} CPU seconds)", flush=True)
    print(f"kernels are ready ({time.monotonic() - started:.1f} s)", flush=True)
