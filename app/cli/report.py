"""The command ``report``: the tables and figures of the thesis beside the results of Tandem."""

import importlib
from pathlib import Path
from typing import Annotated

import typer

from app.cli.options import Json, prepared_settings
from app.cli.output import print_result, write_output
from app.errors import InvalidInput, MissingPackage

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE, RESULTS = DOCS / "report/index.md", DOCS / "results"


def report(
    quick: Annotated[
        bool, typer.Option("--quick", help="Write stored results; measure nothing.")
    ] = False,
    episodes: Annotated[
        int | None, typer.Option(help="Episodes of each evaluation; its own number by default.")
    ] = None,
    output: Annotated[Path, typer.Option(help="Page to write.")] = PAGE,
    results: Annotated[
        Path, typer.Option(help="Folder of the stored results, with --quick.")
    ] = RESULTS,
    as_json: Json = False,
) -> None:
    """Write the report that compares Tandem with the thesis.

    Without --quick its evaluations are measured again as a job of the running server, which
    takes hours; repeated after an interruption, the command continues.
    """
    if not results.is_dir():
        raise InvalidInput("--results", str(results), "must be a folder of result files")
    if quick and episodes is not None:
        raise InvalidInput("--episodes", episodes, "must be left out with --quick")
    if not quick and results != RESULTS:
        raise InvalidInput("--results", str(results), "needs --quick")
    settings = prepared_settings()
    if quick:
        from app.policies.report.page import page

        text, missing = page(results)
        failed: list[str] = []
    else:
        try:
            job = importlib.import_module("app.cli.report_job")
        except ModuleNotFoundError as error:
            if error.name != "httpx":
                raise
            remedy = ".venv/bin/pip install '.[client]', or add --quick"
            raise MissingPackage("httpx", "measuring by the server", remedy) from None
        written = output.stat().st_mtime if output.exists() else 0.0
        result = job.measured_report(settings, episodes, written)
        text, missing, failed = result["markdown"], result["missing"], result["failed"]
    output.parent.mkdir(parents=True, exist_ok=True)
    write_output(output, text.encode())
    said = f"wrote {output}; {len(missing)} measures have no result file"
    if failed:
        said += f"; these evaluations failed: {', '.join(failed)}"
    data = {"page": str(output), "missing": missing, "failed": failed}
    print_result(said, data, as_json=as_json)
