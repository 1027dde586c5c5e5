"""The command ``train``: train a policy in this process, without a server."""

import fcntl
import json
import logging
import os
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from threading import Event
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.options import Json, check_kernels_kept, prepared_settings
from app.cli.output import print_result
from app.durable_files import write_durably
from app.errors import CheckpointMismatch, InvalidInput

if TYPE_CHECKING:
    from app.policies.checkpoints.checkpoint import Checkpoint
    from app.policies.configs.presets import Preset
    from app.policies.training.progress import Progress
    from app.policies.training.state import TrainingState
    from app.sim.cells.cell import Cell

logger = logging.getLogger("app.train")

INTERRUPTED = 130
"""Exit status of a command that was interrupted."""


def train(
    preset: Annotated[
        str,
        typer.Argument(
            show_default=False, help="Such as reach-td3; any other word lists all presets."
        ),
    ],
    seed: Annotated[int, typer.Option(min=0, max=2**31 - 1)] = 0,
    sets: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="FIELD=VALUE", help="Override a field; may be repeated."),
    ] = None,
    output: Annotated[Path, typer.Option(help="Folder of the result.")] = Path(),
    as_json: Json = False,
) -> None:
    """Train a policy in this process, without a server.

    The same command continues an interrupted training, with the same result as without the
    interruption.
    """
    settings = prepared_settings()
    from app.cli.cells import named_cell
    from app.policies.configs import presets

    configuration = presets.resolve(preset, presets.nested(parse_overrides(sets or [])))
    cell = named_cell(configuration.cell, settings)
    check_kernels_kept(settings)
    with in_use(output):
        path = _train(configuration, cell, seed, output)
    print_result(f"wrote {path}", {"checkpoint": str(path)}, as_json=as_json)


def _train(configuration: "Preset", cell: "Cell", seed: int, output: Path) -> Path:
    """Train in a folder that no other process uses; return the path of the policy."""
    import torch

    from app.policies.checkpoints.files import write_files
    from app.policies.training import train as training
    from app.policies.training.state_folder import StateFolder

    torch.set_num_threads(1)
    path, states = output / "policy.safetensors", StateFolder(output / "resume")
    resume = states.newest()
    if resume is not None:
        require_same(resume, configuration, seed, cell, output)
        total = configuration.learning.total_steps
        logger.info("continues at step %d of %d from %s", resume.step, total, output)
    curve = output / "curve.jsonl"
    cut_curve(curve, 0 if resume is None else resume.step)

    def tell(progress: "Progress") -> None:
        _log_progress(progress)
        with curve.open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(progress)) + "\n")

    def write(_step: int, policy: "Checkpoint", state: "TrainingState | None") -> None:
        write_files(path, policy)
        if state is not None:
            states.write(state)

    with _stopped_by_signals() as stop:
        result = training.train(
            configuration,
            seed=seed,
            on_progress=tell,
            on_checkpoint=write,
            should_stop=stop.is_set,
            cell=cell,
            memory=states.memory,
            resume=resume,
        )
    if result.stopped:
        logger.warning(
            "interrupted at step %d: the same command continues from %s", result.step, output
        )
        raise typer.Exit(INTERRUPTED)
    states.remove()
    return path


@contextmanager
def in_use(folder: Path) -> Iterator[None]:
    """Hold the folder of a training; the kernel's lock ends with its process.

    Raises:
        InvalidInput: Another training holds it, or it cannot be written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = (folder / "train.lock").open("a+", encoding="utf-8")
    except OSError as error:
        rule = f"must be a folder that this process may write to ({error.strerror})"
        raise InvalidInput("--output", str(folder), rule) from error
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            file.seek(0)
            rule = (
                f"must not be used by another training (process {file.read(20) or 'unknown'}): "
                "wait for its end, interrupt it by Ctrl-C, or choose another folder"
            )
            raise InvalidInput("--output", str(folder), rule) from error
        file.truncate(0)
        file.write(str(os.getpid()))
        file.flush()
        yield


def require_same(
    state: "TrainingState", preset: "Preset", seed: int, cell: "Cell", folder: Path
) -> None:
    """Check that an interrupted training in a folder is the one that is asked for.

    Raises:
        InvalidInput: A field of the configuration, the seed or the cell differs.
    """
    from app.policies.training.state import require_origin

    try:
        require_origin(state, preset, seed, cell)
    except CheckpointMismatch as error:
        rule = (
            f"differs from {error.actual!r} of the interrupted training in {folder}: continue "
            f"that one with its value, choose another folder by --output, or delete "
            f"{folder / 'resume'}"
        )
        raise InvalidInput(error.field, error.expected, rule) from error


def cut_curve(path: Path, step: int) -> None:
    """Delete the points of a learning curve beyond a step, which are measured again."""
    if path.exists():
        lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
        kept = [line for line in lines if line.endswith("\n")]
        before = "".join(one for one in kept if json.loads(one)["step"] <= step)
        write_durably(path, before.encode())


def parse_overrides(sets: Sequence[str]) -> dict[str, Any]:
    """Return the overrides of ``FIELD=VALUE`` pairs; values are JSON where valid, else text.

    Raises:
        InvalidInput: A pair has no ``=``.
    """
    overrides: dict[str, Any] = {}
    for pair in sets:
        name, sign, text = pair.partition("=")
        if not sign:
            raise InvalidInput("--set", pair, "must have the form FIELD=VALUE")
        try:
            overrides[name] = json.loads(text)
        except (ValueError, RecursionError):
            overrides[name] = text
    return overrides


@contextmanager
def _stopped_by_signals() -> Iterator[Event]:
    """Set an event at the first Ctrl-C or SIGTERM; a second one ends the process at once."""
    stop = Event()
    known: dict[int, Any] = {}

    def ask(_signal: int, _frame: FrameType | None) -> None:
        restore()  # first: a second signal must not wait for the lock of the event
        stop.set()
        logger.warning("stops after this step and writes its state")

    def restore() -> None:
        for number, handler in known.items():
            signal.signal(number, handler)

    for one in (signal.SIGINT, signal.SIGTERM):
        known[one] = signal.signal(one, ask)
    try:
        yield stop
    finally:
        restore()


def _log_progress(progress: "Progress") -> None:
    rates = {name: getattr(progress, name) for name in ("success", "collision", "timeout")}
    known = [f"{name} {rate:.3f}" for name, rate in rates.items() if rate is not None]
    left = progress.time_left_s
    logger.info(
        "%d of %d steps, %s: %s",
        progress.step,
        progress.total_steps,
        "no updates yet" if left is None else f"{left:.0f} s left",
        ", ".join(known) or "no episode has ended yet",
    )
