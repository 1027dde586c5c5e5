import math

import numpy as np
import pytest

from app.live import commands
from app.live.people.pedestrians import DRAG_SPEED, LivePedestrians
from app.sim.cells.cell import load_cell

CELL = load_cell("shared-workspace")
DT = CELL.robot.dt


@pytest.fixture
def walkers() -> LivePedestrians:
    return LivePedestrians(CELL, seed=4)


def test_velocity_tells_where_a_walker_is_one_period_later(walkers: LivePedestrians) -> None:
    for _ in range(400):
        before = walkers[0].as_observed()
        walkers.move(DT)
        moved = (walkers.cylinders[0, :2] - before.cylinder[:2]) / DT
        assert np.allclose(moved, before.qd[:2], atol=1e-9) or np.allclose(
            walkers.cylinders[0, :2], walkers.rows[0, [7, 8]], atol=0.11
        )


def test_people_at_a_target_walk_on(walkers: LivePedestrians) -> None:
    last = walkers.cylinders[0, :2].copy()
    for _ in range(8):
        for _ in range(1500):
            walkers.move(DT)
        assert not np.allclose(walkers.cylinders[0, :2], last)
        last = walkers.cylinders[0, :2].copy()


def test_dragged_person_follows_with_bounded_speed_and_arrives(
    walkers: LivePedestrians,
) -> None:
    walkers[0].drag(commands.MovePerson(pelvis=(0.5, 1.5, 0.0)))
    for _ in range(300):
        before = walkers.cylinders[0, :2].copy()
        velocity = walkers[0].as_observed().qd[:2].copy()
        walkers.move(DT)
        step = walkers.cylinders[0, :2] - before
        assert np.allclose(step, velocity * DT, atol=1e-9)
        assert np.linalg.norm(step) <= DRAG_SPEED * DT + 1e-9
    assert np.allclose(walkers.cylinders[0, :2], (0.5, 1.5), atol=1e-3)


def test_dragged_person_does_not_pass_its_target_in_long_periods() -> None:
    robot = CELL.robot.model_copy(update={"dt": 0.2})
    walkers = LivePedestrians(CELL.model_copy(update={"robot": robot}), seed=4)
    start = walkers.cylinders[0, 0]
    x, y = start + 0.1, walkers.cylinders[0, 1]
    walkers[0].drag(commands.MovePerson(pelvis=(x, y, 0.0)))
    for _ in range(10):
        walkers.move(0.2)
        assert start - 1e-9 <= walkers.cylinders[0, 0] <= x + 1e-9
    assert walkers.cylinders[0, 0] == pytest.approx(x)


def test_person_is_not_dragged_out_of_sight(walkers: LivePedestrians) -> None:
    walkers[0].drag(commands.MovePerson(pelvis=(50.0, -50.0, 0.0)))
    for _ in range(500):
        walkers.move(DT)
    x, y, _ = walkers.cylinders[0]
    assert (x, y) == pytest.approx((1.6, -0.1), abs=1e-3)
    assert walkers[0].snapshot(1.0, nearest=True).outside_area


def test_all_walk_with_the_speed_that_was_asked_for_and_again_as_they_like(
    walkers: LivePedestrians,
) -> None:
    own = walkers.rows[0].copy()
    walkers.set_speed(1.6)
    walkers.change(commands.AddPerson())
    walkers.move(DT)
    speeds = [math.hypot(*one.as_observed().qd[:2]) for one in walkers]
    assert speeds == pytest.approx([1.6, 1.6])
    walkers.set_speed(None)
    assert np.array_equal(walkers.rows[0, 13:21], own[13:21])


def test_those_who_come_in_have_room_and_keep_their_ids(walkers: LivePedestrians) -> None:
    for _ in range(3):
        walkers.change(commands.AddPerson())
    assert walkers.ids == (0, 1, 2, 3)
    places = walkers.cylinders[:, :2]
    gaps = [np.linalg.norm(a - b) for i, a in enumerate(places) for b in places[i + 1 :]]
    assert min(gaps) > 0.5
    walkers.change(commands.RemovePerson(person=1))
    assert walkers.ids == (0, 2, 3)
    assert np.array_equal(walkers.cylinders[:, :2], places[[0, 2, 3]])


def test_person_who_shall_stand_stands_and_walks_again(walkers: LivePedestrians) -> None:
    walkers[0].enter("still")
    before = walkers.cylinders[0, :2].copy()
    for _ in range(50):
        walkers.move(DT)
    assert np.array_equal(walkers.cylinders[0, :2], before)
    walkers[0].enter("auto")
    for _ in range(200):
        walkers.move(DT)
    assert not np.allclose(walkers.cylinders[0, :2], before)


def test_mannequin_turns_where_it_walks(walkers: LivePedestrians) -> None:
    walkers.set_speed(0.5)
    for _ in range(100):
        walkers.move(DT)
    vx, vy = walkers[0].as_observed().qd[:2]
    if math.hypot(vx, vy) > 0.1:
        turn = math.atan2(vy, vx) - walkers[0].yaw
        assert math.cos(turn) > 0.9
