"""People found by a search: motions inside the limits, and the evaluation beside them."""

import numpy as np
import pytest

from app.policies.checkpoints import pretrained
from app.policies.evaluation.pick.worst_people import motion_of, stored_motions
from app.policies.evaluation.registry import evaluate
from app.sim.cells.cell import load_cell
from app.sim.human.kernels import kinematics as body
from tools.search_worst_people import (
    BOX,
    N_NUMBERS,
    N_POINTS,
    PAUSES,
    SPEEDS,
    hand_motion,
    numbers_of,
)

CELL = load_cell("pick-and-place")


@pytest.mark.parametrize("end", [0, 1])
def test_numbers_span_the_limits(end: int) -> None:
    motion = hand_motion(np.full(N_NUMBERS, float(end)))
    assert motion.hand == "rl"[end]
    assert motion.palms == (BOX[end],) * N_POINTS
    assert set(motion.speeds) == {SPEEDS[end]}
    assert set(motion.pauses) == {PAUSES[end]}


def test_numbers_of_a_motion_are_those_it_was_made_of() -> None:
    assert [hand_motion(numbers_of(one)) for one in stored_motions()] == list(stored_motions())


def test_the_palm_rests_at_the_points_and_moves_at_the_speeds() -> None:
    numbers = np.random.default_rng(4).uniform(0.3, 0.7, N_NUMBERS)
    motion = hand_motion(numbers)
    run = motion_of(CELL, motion, "one")
    palm = {"r": body.HAND_R, "l": body.HAND_L}[motion.hand]
    trig, frames = np.zeros((3, 16)), np.zeros((body.N_FRAMES, 3, 3))
    points, path = np.zeros((body.N_POINTS, 3)), []
    for q in run.q:
        body.points_and_frames(q, CELL.body, trig, points, frames)
        path.append(points[palm].copy())
    for point in motion.palms:
        assert np.linalg.norm(np.array(path) - point, axis=1).min() < 0.03
    lengths = np.linalg.norm(np.diff(motion.palms, axis=0), axis=1)
    moving = (lengths / motion.speeds).sum()
    assert run.times[-1] == pytest.approx(moving + sum(motion.pauses), abs=0.05)


def test_stored_motions_lie_inside_the_limits() -> None:
    for motion in stored_motions():
        assert (np.array(motion.palms) >= BOX[0]).all()
        assert (np.array(motion.palms) <= BOX[1]).all()
        assert SPEEDS[0] <= min(motion.speeds) <= max(motion.speeds) <= SPEEDS[1]
        assert PAUSES[0] <= min(motion.pauses) <= max(motion.pauses) <= PAUSES[1]


def test_the_policy_succeeds_less_beside_the_people_who_were_found() -> None:
    result = evaluate("pick-worst", pretrained.load("pick"), episodes=40, seed=5)
    rows = {row["name"]: row for row in result["results"]}
    assert list(rows)[:2] == ["library", "found"]
    assert len(rows) == 2 + len(stored_motions())
    assert rows["found"]["success"]["mean"] < rows["library"]["success"]["mean"]
