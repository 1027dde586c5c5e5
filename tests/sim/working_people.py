"""Recorded runs whose person and height are known, for tests of people who follow them."""

import numpy as np

from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.human.anthropometry import MEDIAN, BodySize
from app.sim.mocap.importer import Motion
from app.sim.people.human_motion_config import HumanMotionConfig, at_the_table
from tests.sim.recorded_person import working


def run_of(
    q: Vec,
    dt: float = 0.02,
    pelvis_z: Vec | float = 0.0,
    size: BodySize = MEDIAN,
    name: str = "made",
) -> Motion:
    """A run of given joints [m, rad], shape (n, 18), at equal steps [s]."""
    return Motion(
        name=name,
        source=f"{name}, made up",
        times=dt * np.arange(len(q)),
        q=q,
        pelvis_z=np.broadcast_to(pelvis_z, len(q)).astype(np.float64),
        size=size,
        first_frame=0,
    )


def recorded_work(cell: Cell, n: int = 700) -> HumanMotionConfig:
    """Two people of two sizes who work at the cell's table, 14 s each."""
    tall = BodySize(pelvis=1.02, upper_arm_r=0.32, upper_arm_l=0.32)
    runs = (
        run_of(working(n), name="a"),
        run_of(working(n, seed=1), pelvis_z=-0.05, size=tall, name="b"),
    )
    placed = tuple(at_the_table(run, cell) for run in runs)
    return HumanMotionConfig(motion="recorded", recorded=placed)
