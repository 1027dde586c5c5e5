"""Playback of a recorded motion in a cell."""

from dataclasses import replace

import numpy as np
import pytest

from app.live import playback
from app.live.playback import PlayedMotion, Recording
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.human.anthropometry import BodySize
from app.sim.mocap.importer import Motion
from app.sim.mocap.joint_centres import model_points
from app.sim.people.human_motion_config import at_the_table
from tests.sim.recorded_motion import recorded


def played(motion: Motion, cell: Cell) -> PlayedMotion:
    return PlayedMotion(Recording(motion, "made-up"), cell, cell.human)


@pytest.mark.parametrize("t", [-1.0, 0.0, 0.013, 1.0, 1.999, 2.0, 9.0])
def test_joints_between_frames_are_interpolated(cell: Cell, t: float) -> None:
    motion = recorded()
    path = at_the_table(motion, cell).q
    expected = [np.interp(t, motion.times, joint) for joint in path.T]
    np.testing.assert_allclose(played(motion, cell).at(t)[0], expected, atol=1e-12)


@pytest.mark.parametrize(("shoulder", "least", "most"), [(0.9, 0.0, 0.0), (3.5, 0.1, 0.4)])
def test_error_at_the_wrists_takes_joint_centres_of_clipped_frames_alone(
    cell: Cell, monkeypatch: pytest.MonkeyPatch, shoulder: float, least: float, most: float
) -> None:
    frames = []

    def noted(q: Vec, pelvis_z: Vec, size: BodySize) -> Vec:
        frames.append(len(q))
        return model_points(q, pelvis_z, size)

    monkeypatch.setattr(playback, "model_points", noted)
    motion = recorded(shoulder=shoulder)
    shown = played(motion, cell).snapshot(0.0)
    assert set(frames) == {round(shown.clipped_share * len(motion.q))}
    assert least <= shown.clipped_m <= most


def test_speeds_of_a_recording_stay_within_what_a_policy_takes(cell: Cell) -> None:
    motion = recorded()
    q = motion.q.copy()
    q[50:, 2] += 3.0
    jerk = played(replace(motion, q=q), cell)
    fastest = max(np.abs(jerk.at(0.01 * k)[1]).max() for k in range(200))
    assert fastest == 50.0
