"""The command ``export``: write a checkpoint as an ONNX model."""

import importlib
from pathlib import Path
from typing import Annotated

import typer

from app.cli.evaluate import find_checkpoint
from app.cli.options import Json, prepared_settings
from app.cli.output import print_result, write_output
from app.errors import MissingPackage


def export(
    checkpoint: Annotated[
        str, typer.Argument(help="Alias, SHA-256 or .safetensors file.", show_default=False)
    ],
    output: Annotated[
        Path | None, typer.Option(help="File to write; the checkpoint's name by default.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Write a pick or reach policy as an ONNX model."""
    settings = prepared_settings()
    try:
        onnx_export = importlib.import_module("app.policies.inference.onnx_export")
    except ModuleNotFoundError as error:
        if error.name != "onnx":
            raise
        remedy = ".venv/bin/pip install '.[onnx]'"
        raise MissingPackage("onnx", "the export", remedy) from None
    file = Path(checkpoint)
    name = file.stem if file.suffix == ".safetensors" else checkpoint
    content = onnx_export.export(find_checkpoint(checkpoint, settings), name)
    path = output or Path(f"{name}.onnx")
    write_output(path, content)
    text = f"wrote {path}\n{onnx_export.LIMITS}"
    data = {"file": str(path), "bytes": len(content), "limits": onnx_export.LIMITS}
    print_result(text, data, as_json=as_json)
