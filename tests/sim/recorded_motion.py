"""A short made-up recording, as an import would deliver it: steps, turns, bends and reaches."""

import numpy as np

from app.sim.human.anthropometry import BodySize
from app.sim.human.model import rest_posture
from app.sim.mocap.importer import Motion

DT = 0.02


def recorded(
    seconds: float = 2.0,
    *,
    walk: float = 0.3,
    dip: float = 0.1,
    shoulder: float = 0.9,
    turn: float = 0.5,
    size: BodySize | None = None,
) -> Motion:
    """A person who walks ``walk`` [m] ahead, lowers the pelvis by ``dip`` [m] and reaches."""
    n = round(seconds / DT) + 1
    share = np.linspace(0.0, 1.0, n)
    smooth = share * share * (3.0 - 2.0 * share)
    q = np.tile(rest_posture(2.0, -1.0, 0.4), (n, 1))
    q[:, 0] += walk * np.cos(0.4) * smooth
    q[:, 1] += walk * np.sin(0.4) * smooth
    q[:, 2] += turn * smooth
    q[:, 3] += 0.4 * np.sin(np.pi * share)
    q[:, 10] += shoulder * smooth
    return Motion(
        name="made-up",
        source="made-up.csv (000000000000), frames 0 to 100",
        times=DT * np.arange(n),
        q=q,
        pelvis_z=-dip * np.sin(np.pi * share),
        size=size or BodySize(upper_arm_r=0.33, forearm_r=0.28),
        first_frame=0,
    )
