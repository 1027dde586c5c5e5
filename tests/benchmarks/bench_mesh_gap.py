"""How much nearer the robot's capsules are to a person than its raw meshes.

    python -m app bench mesh-gap [--json]

Working postures: the tool points down over the table, every joint then turned a little at
random, and a person is somewhere in the work cycle; those in which they are apart, by less than
half a metre. ``links`` leaves out postures in which the tool is nearest: the tool is a capsule,
and adds nothing. ``value`` is the mean, ``low`` and ``high`` the least and the greatest gap; a
gap below zero would mean a contact reported too late.
"""

import statistics

import numpy as np

from app.sim.cells.cell import load_cell
from app.sim.robot.capsules import TOOL
from app.sim.scene.scene import arm_of
from tests.benchmarks.measure import Row, arguments, report
from tests.sim.mesh_gap import Gap, gaps

BENCH = "mesh-gap"
POSTURES = 2000
"""Postures drawn; some are left out."""


def measured(name: str, found: list[Gap]) -> Row:
    """Return the row of some postures."""
    gap = [1e3 * (one.meshes - one.capsules) for one in found]
    return {
        "name": name,
        "threads": 1,
        "batch": len(gap),
        "value": statistics.mean(gap),
        "low": min(gap),
        "median": statistics.median(gap),
        "p95": float(np.percentile(gap, 95)),
        "high": max(gap),
        "unit": "mm",
    }


def main() -> None:
    """Measure and print."""
    options = arguments(BENCH)
    cell = load_cell()
    found = gaps(cell, arm_of(cell), POSTURES, options.seed)
    links = [one for one in found if one.nearest != TOOL]
    rows = [measured("robot-and-tool", found), measured("links", links)]
    report(BENCH, rows, options)


if __name__ == "__main__":
    main()
