"""Whether points lie in a safety cylinder."""

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.perception.bounding_cylinder import SafetyCylinder


def holds(cylinder: SafetyCylinder, points: Vec) -> bool:
    """Whether no point [m], shape (n, 3), is beyond the radius or above the top."""
    away = np.linalg.norm(points[:, :2] - cylinder.center, axis=1)
    return bool((away <= cylinder.radius).all() and (points[:, 2] <= cylinder.top).all())
