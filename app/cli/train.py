"""The command ``train``: train a policy in this process, without a server."""

import json
import logging
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.options import Json, prepared_settings
from app.cli.output import print_result
from app.errors import InvalidInput

if TYPE_CHECKING:
    from app.policies.checkpoints.checkpoint import Checkpoint
    from app.policies.training.progress import Progress

logger = logging.getLogger("app.train")


def train(
    preset: Annotated[str, typer.Argument(show_default=False)],
    seed: int = 0,
    sets: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="FIELD=VALUE", help="Override a field; may be repeated."),
    ] = None,
    output: Annotated[Path, typer.Option(help="Folder of the result.")] = Path(),
    as_json: Json = False,
) -> None:
    """Train a policy in this process, without a server."""
    settings = prepared_settings()
    import torch

    from app.cli.cells import named_cell
    from app.policies.configs import presets
    from app.policies.training import train as training

    configuration = presets.resolve(preset, presets.nested(parse_overrides(sets or [])))
    cell = named_cell(configuration.cell, settings)
    output.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    path = output / "policy.safetensors"

    def write(_step: int, policy: "Checkpoint", _resume: "Checkpoint") -> None:
        path.write_bytes(policy.tensors)
        path.with_suffix(".json").write_text(json.dumps(policy.manifest, indent=1))

    training.train(
        configuration,
        seed=seed,
        resume=None,
        on_progress=_log_progress,
        on_checkpoint=write,
        should_stop=lambda: False,
        cell=cell,
    )
    print_result(f"wrote {path}", {"checkpoint": str(path)}, as_json=as_json)


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
        except ValueError:
            overrides[name] = text
    return overrides


def _log_progress(progress: "Progress") -> None:
    rates = {
        "success": progress.success,
        "collision": progress.collision,
        "timeout": progress.timeout,
    }
    known = [f"{name} {rate:.3f}" for name, rate in rates.items() if rate is not None]
    left = progress.time_left_s
    logger.info(
        "%d of %d steps, %s: %s",
        progress.step,
        progress.total_steps,
        "no updates yet" if left is None else f"{left:.0f} s left",
        ", ".join(known) or "no episode has ended yet",
    )
