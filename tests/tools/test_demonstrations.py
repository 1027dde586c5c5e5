"""Demonstrations: whole, smooth, clear of the table, in the style that was asked for."""

import numpy as np
import pytest

from app.errors import SimulationError
from app.sim.cells.cell import Cell, load_cell
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.anthropometry import percentile_body
from app.sim.primitives.keyframes import (
    OVER_TABLE,
    STYLES,
    Style,
    draw_keyframe,
    height_over_table,
)
from tools.demonstrations import LARGEST_STEP, between, demonstrate

CELL = load_cell()
PEOPLE = {
    row: percentile_body(*row, CELL.human.pelvis_height).vector(CELL.floor_z)
    for row in ((5.0, 5.0, 5.0), (50.0, 50.0, 50.0), (95.0, 95.0, 95.0), (5.0, 95.0, 50.0))
}
BY_NAME = {style.name: style for style in STYLES}


def palms_of(q: Vec, size: Vec) -> Vec:
    return np.array([human.palms(row, size) for row in q])


def station(name: str, cell: Cell = CELL) -> Vec:
    return np.array(cell.station(name).position)


@pytest.mark.parametrize("style", STYLES, ids=lambda style: style.name)
@pytest.mark.parametrize("row", PEOPLE)
def test_demonstrations_are_smooth_and_inside_the_limits(
    row: tuple[float, ...], style: Style
) -> None:
    rng, size = np.random.default_rng(3), PEOPLE[row]
    for ends in ((None, station("cube0")), (station("cube4"), station("dock1"))):
        q = demonstrate(CELL, size, ends, "l", style, rng).q
        assert np.abs(np.diff(q[:, 3:], axis=0)).max() <= LARGEST_STEP
        assert (q > human.Q_MIN).all() and (q < human.Q_MAX).all()
        assert height_over_table(CELL, palms_of(q, size)).min() >= OVER_TABLE


@pytest.mark.parametrize("row", PEOPLE)
@pytest.mark.parametrize("hand", ["r", "l"])
def test_palm_goes_from_station_to_station(row: tuple[float, ...], hand: human.Hand) -> None:
    rng, size = np.random.default_rng(4), PEOPLE[row]
    ends = station("cube1"), station("dock0")
    q = demonstrate(CELL, size, ends, hand, STYLES[0], rng).q
    palms = palms_of(q[[0, -1]], size)[:, 0 if hand == "r" else 1]
    assert np.linalg.norm(palms - ends, axis=1).max() < 0.08


def test_motion_between_keyframes_begins_and_ends_in_them() -> None:
    rng, size = np.random.default_rng(5), PEOPLE[(50.0, 50.0, 50.0)]
    first = draw_keyframe(CELL, size, None, "r", rng)
    then = draw_keyframe(CELL, size, station("cube3"), "r", rng)
    q, reached = between(size, first, then, STYLES[0], rng)
    assert reached
    np.testing.assert_allclose(q[[0, -1]], [first.q, then.q], atol=1e-9)


def test_palm_is_lifted_on_its_path() -> None:
    rng, size = np.random.default_rng(6), PEOPLE[(50.0, 50.0, 50.0)]
    ends = [draw_keyframe(CELL, size, station(name), "r", rng) for name in ("cube1", "dock0")]
    q, _ = between(size, ends[0], ends[1], BY_NAME["careful"], rng)
    height = palms_of(q, size)[:, 0, 2]
    straight = np.linspace(height[0], height[-1], len(height))
    assert 0.04 < (height - straight).max() < 0.13


def test_careful_people_are_slower_and_brisk_ones_faster() -> None:
    size, ends = PEOPLE[(50.0, 50.0, 50.0)], (None, station("cube2"))

    def median(name: str) -> float:
        rng = np.random.default_rng(7)
        every = [demonstrate(CELL, size, ends, "r", BY_NAME[name], rng) for _ in range(12)]
        return float(np.median([one.duration_s for one in every]))

    assert median("brisk") < median("upright") < median("careful")


def test_place_out_of_reach_is_reported() -> None:
    rng, size = np.random.default_rng(9), PEOPLE[(5.0, 5.0, 5.0)]
    far = np.array([0.0, -0.4, 0.1])
    with pytest.raises(SimulationError, match="no feasible motion of hand 'r'"):
        demonstrate(CELL, size, (None, far), "r", STYLES[0], rng)
