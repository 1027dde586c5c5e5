"""The command ``report``: the tables and figures of the thesis beside the results of Tandem."""

from pathlib import Path
from typing import Annotated

import typer

from app.cli.options import Json, prepared_settings
from app.cli.output import print_result, write_output
from app.errors import InvalidInput

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE, RESULTS = DOCS / "report/index.md", DOCS / "results"


def report(
    output: Annotated[Path, typer.Option(help="Page to write.")] = PAGE,
    results: Annotated[Path, typer.Option(help="Folder of the result files.")] = RESULTS,
    as_json: Json = False,
) -> None:
    """Write the report that compares Tandem with the thesis, from stored results."""
    if not results.is_dir():
        raise InvalidInput("--results", str(results), "must be a folder of result files")
    prepared_settings()
    from app.policies.report.page import page

    text, missing = page(results)
    output.parent.mkdir(parents=True, exist_ok=True)
    write_output(output, text.encode())
    said = f"wrote {output}; {len(missing)} measures have no result file"
    print_result(said, {"page": str(output), "missing": missing}, as_json=as_json)
