"""Result files of ``docs/results``."""

import json
from pathlib import Path
from typing import Any

from app.provenance import describe

ROOT = Path(__file__).resolve().parents[2]
RESULTS, IMAGES = ROOT / "docs/results", ROOT / "docs/img"
Json = dict[str, Any]


def read_result(path: Path) -> Json:
    """Return the content of a result file."""
    found: Json = json.loads(path.read_text(encoding="utf-8"))
    return found


def read_if_measured(path: Path) -> Json | None:
    """Return the content of a result file; None if it does not exist."""
    return read_result(path) if path.exists() else None


def write_result(path: Path, result: Json) -> None:
    """Write a result; the machine and the commit are added where they are not stated."""
    stated = result if "machine" in result else {**result, "machine": describe()}
    path.write_text(json.dumps(stated, indent=1) + "\n", encoding="utf-8")
