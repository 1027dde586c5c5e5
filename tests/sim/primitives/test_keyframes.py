"""Keyframes: postures at a place in the style that was asked for."""

import numpy as np

from app.sim.cells.cell import load_cell
from app.sim.human import model as human
from app.sim.human.anthropometry import percentile_body
from app.sim.primitives.keyframes import STYLES, draw_keyframe

CELL = load_cell()
BY_NAME = {style.name: style for style in STYLES}


def test_elbows_go_out_in_their_style() -> None:
    median = percentile_body(50.0, 50.0, 50.0, CELL.human.pelvis_height)
    rng, size = np.random.default_rng(8), median.vector(CELL.floor_z)
    place = np.array(CELL.station("cube2").position)

    def outward(name: str) -> float:
        """Return how far the right elbow is to the right of the arm's ends on average [m]."""
        found = []
        for _ in range(12):
            keyframe = draw_keyframe(CELL, size, place, "r", rng, BY_NAME[name])
            points = human.joint_points(keyframe.q, size)
            middle = 0.5 * (points["shoulder_r"] + points["hand_r"])
            found.append(middle[0] - points["elbow_r"][0])  # who faces the robot has -x there
        return float(np.mean(found))

    assert outward("elbow-out") > outward("upright") + 0.03
