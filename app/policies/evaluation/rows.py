"""Input of a protocol, and rows that are reported as soon as they are measured."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from app.sim.mocap.importer import Motion

Json = dict[str, Any]
Row = Mapping[str, Any]
"""One row of a result."""
OnRow = Callable[[int, int, Row], None]
"""Called with the number of finished rows, the total number of rows, and the newest row."""


def ignore_row(_done: int, _total: int, _row: Row) -> None:
    """Do nothing: the default callback."""


class ReportedRows(list[Json]):
    """Rows of a result, ``total`` in the end; each is reported when it is appended."""

    def __init__(self, total: int, on_row: OnRow) -> None:
        super().__init__()
        self._total, self._on_row = total, on_row

    def append(self, row: Json) -> None:
        """Add a row and report it."""
        super().append(row)
        self._on_row(len(self), self._total, row)


@dataclass(frozen=True, slots=True, kw_only=True)
class EvaluationRequest:
    """Input of a protocol besides the checkpoint."""

    episodes: int | None = None
    """Number of episodes of each row; None for the usual one."""
    seed: int = 11
    """Seed of the episodes; use one that was not used for tuning."""
    motions: Sequence[Motion] = ()
    """Recorded motion without artefacts, for protocols that use it."""
    on_row: OnRow = ignore_row
    """Callback for each finished row."""

    def rows(self, total: int) -> ReportedRows:
        """Return the list of the ``total`` rows of the result, still empty."""
        return ReportedRows(total, self.on_row)
