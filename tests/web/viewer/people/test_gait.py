import math

import numpy as np

from app.sim.cells.cell import load_cell
from app.sim.human import model as human
from web.viewer.people.gait import Gait


def test_feet_follow_a_pelvis_that_faces_the_opposite_direction() -> None:
    cell = load_cell()
    for yaw in np.random.default_rng(0).uniform(-math.pi, math.pi, 100):
        before, after = (
            human.body_frames(human.rest_posture(0.0, 1.0, turned), cell.body)["pelvis"]
            for turned in (yaw, yaw + math.pi)
        )
        gait = Gait(cell.floor_z)
        for pelvis in (before, *[after] * 20):
            gait.follow(pelvis, 0.05)
        ahead = [float(foot[:3, 0] @ after[:3, 0]) for foot in gait.feet.values()]
        assert min(ahead) > 0.9
