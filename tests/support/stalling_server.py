"""A server whose first live world hangs in its tick for as long as a file exists.

``python -m tests.support.stalling_server serve``; ``HANG_FILE`` names the file. Worlds
that are started later go on.
"""

import os
import sys
import time
from pathlib import Path
from typing import Any

from app.cli.entry import main
from web.viewer.loop import LiveCell

HANG = Path(os.environ["HANG_FILE"])
tick = LiveCell._tick
cells: list[LiveCell] = []


def hanging_tick(cell: LiveCell, *terms: Any) -> None:
    """Tick, if it is not the first cell, or once the file is gone."""
    cells[:] = cells or [cell]
    while cell is cells[0] and HANG.exists():
        time.sleep(0.05)
    tick(cell, *terms)


LiveCell._tick = hanging_tick  # type: ignore[method-assign]
sys.exit(main())
