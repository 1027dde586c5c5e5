"""The Typer application and its entry point.

Results go to standard output (``--json``: one object), logs and errors to standard error.
Exit status: 0 whatever the result, 1 where this machine is in the way (port taken, database
in use, disk full, report folder that cannot be made, library missing, start failed), 2 for a
wrong call, such as a file that cannot be read or a data folder that cannot be made or written.
"""

import io
import sys
from collections.abc import Sequence
from typing import Annotated

import typer

from app import logs
from app.cli import backup, cells, evaluate, export, recordings, serve, train
from app.cli.report import report
from app.errors import InvalidInput, NotFound, ServiceError
from app.provenance import VERSION, describe

app = typer.Typer(
    help="Decisions and motions of a robot arm that shares its work cell with people.",
    add_completion=False,
    rich_markup_mode=None,
)


def print_version(asked: bool) -> None:
    """Print the version and end the command, where the option is given."""
    if asked:
        commit = describe()["commit"]
        print(f"Tandem {VERSION}" + (f", commit {commit}" if commit else ""))
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=print_version, is_eager=True, help="Print the version."
        ),
    ] = False,
) -> None:
    """Take the options before a command."""


app.command()(serve.serve)
app.command()(serve.setup)
app.command()(backup.backup)
app.command()(backup.restore)
app.command()(train.train)
app.command()(evaluate.evaluate)
app.command()(report)
app.command()(export.export)
app.command(context_settings={"allow_extra_args": True, "ignore_unknown_options": True})(
    evaluate.bench
)
app.add_typer(cells.app, name="cells")
app.add_typer(recordings.app, name="recordings")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command, by default that of the process; return the exit status."""
    logs.set_up("text")
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # names of files may be any bytes
    try:
        app(arguments, prog_name="python -m app")
    except SystemExit as end:
        return int(end.code or 0)
    except ServiceError as error:
        print(f"tandem: {error.message}", file=sys.stderr)
        return 2 if isinstance(error, InvalidInput | NotFound) else 1
    except ImportError as error:
        if "cannot open shared object file" not in str(error):
            raise
        print(f"tandem: a library of the system is missing: {error}", file=sys.stderr)
        return 1
    except OSError as error:
        place = "" if error.filename is None else f"{error.filename}: "
        print(f"tandem: {place}{error.strerror or error}", file=sys.stderr)
        return 1
    return 0
