"""The commands ``evaluate`` and ``bench``."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.cells import file_content
from app.cli.options import (
    Json,
    Map,
    RootUnit,
    Unit,
    Up,
    check_kernels_kept,
    prepared_settings,
    read_options,
)
from app.cli.output import every_fault_printed, print_result, table
from app.errors import InvalidInput, NotFound

if TYPE_CHECKING:
    from app.policies.checkpoints.checkpoint import Checkpoint
    from app.settings import Settings

ROOT = Path(__file__).resolve().parents[2]
PROTOCOL_HELP = "Such as pick-single; any other word lists all protocols."
CHECKPOINT_HELP = "Alias, SHA-256 or .safetensors file; the protocol's own by default."


def evaluate(
    protocol: Annotated[str, typer.Argument(show_default=False, help=PROTOCOL_HELP)],
    files: Annotated[
        list[Path] | None, typer.Argument(help="Recorded motion, for pick-mocap and others.")
    ] = None,
    checkpoint: Annotated[str | None, typer.Option(help=CHECKPOINT_HELP)] = None,
    episodes: Annotated[
        int | None, typer.Option(help="Number of episodes; the protocol's own by default.")
    ] = None,
    seed: int = 11,
    unit: Unit = None,
    root_unit: RootUnit = None,
    up: Up = None,
    names: Map = None,
    as_json: Json = False,
) -> None:
    """Evaluate a checkpoint by a protocol."""
    settings = prepared_settings()
    import torch

    from app.cli.recordings import clean_runs
    from app.policies.evaluation import registry as protocols
    from app.provenance import describe

    files = files or []
    if protocol not in protocols.PROTOCOLS:
        raise NotFound("protocol", protocol, tuple(protocols.PROTOCOLS))
    example = f"evaluate {protocol} FILE ..."
    protocols.check_motions(protocol, [str(path) for path in files], "FILE", example)
    with every_fault_printed("", as_json=as_json):
        motions = clean_runs(files, read_options(unit, root_unit, up, names))
    protocols.require_use(protocol, checkpoint)
    reference = protocols.default_checkpoint(protocol) if checkpoint is None else checkpoint
    tested = None if reference is None else find_checkpoint(reference, settings)
    check_kernels_kept(settings)
    torch.set_num_threads(1)
    result = protocols.evaluate(protocol, tested, episodes=episodes, seed=seed, motions=motions)
    result = {**result, "machine": describe()}
    print_result(table(result), result, as_json=as_json)


def find_checkpoint(reference: str, settings: "Settings") -> "Checkpoint":
    """Return a checkpoint.

    Args:
        reference: A file, a shipped alias, or a SHA-256 or alias of the database.

    Raises:
        NotFound: No checkpoint has that name.
        InvalidInput: Its file or the manifest beside it cannot be read.
        Damaged: It is damaged.
    """
    from app.cli.database import has_database, opened
    from app.policies.checkpoints import pretrained
    from app.policies.checkpoints.checkpoint import MAX_BYTES, load
    from app.policies.checkpoints.files import read_files
    from jobs.checkpoints import read_sound

    path = Path(reference)
    if path.suffix == ".safetensors":
        if not path.is_file():
            raise NotFound("checkpoint file", reference)
        return read_files(path, lambda one: load(_manifest(one), file_content(path, MAX_BYTES)))
    if reference in pretrained.ALIASES:
        return pretrained.load(reference)
    if not has_database(settings):
        raise NotFound("checkpoint", reference, tuple(pretrained.ALIASES))
    with opened(settings, "checkpoint") as store:
        record, tensors = read_sound(store, reference)
        return load(record.manifest, tensors)


def _manifest(path: Path) -> object:
    """Return the manifest in the file beside a checkpoint's tensors.

    Raises:
        InvalidInput: It cannot be read.
    """
    from app.policies.checkpoints.upload import MAX_MANIFEST

    content = file_content(path, MAX_MANIFEST)
    try:
        return json.loads(content)
    except (ValueError, RecursionError) as error:
        rule = f"must be the checkpoint's manifest, JSON of at most {MAX_MANIFEST} bytes"
        raise InvalidInput("FILE", str(path), f"{rule}: {error}") from error


def bench(
    context: typer.Context,
    name: Annotated[
        str,
        typer.Argument(
            help="Such as sim-steps; any other word lists all benchmarks.", show_default=False
        ),
    ],
) -> None:
    """Run a benchmark of the checkout; further options are passed to it."""
    folder = ROOT / "tests" / "benchmarks"
    scripts = {
        path.stem.removeprefix("bench_").replace("_", "-"): path
        for path in sorted(folder.glob("bench_*.py"))
    }
    if name not in scripts:
        raise InvalidInput("NAME", name, "is not a benchmark of this checkout", list(scripts))
    check_kernels_kept(prepared_settings())
    command = [sys.executable, str(scripts[name]), *context.args]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    raise typer.Exit(subprocess.run(command, env=environment, check=False).returncode)
