from dataclasses import replace

import numpy as np
import pytest

from app.errors import BadRecording
from app.sim.mocap.bvh import read_bvh
from app.sim.mocap.read_options import UP_AXES, ReadOptions
from app.sim.mocap.skeletons import body_track
from app.sim.mocap.up_axis import z_up
from tests.sim.recorded_person import fault_of
from tests.sim.recorded_skeleton import Person, skeleton


def fault(who: Person) -> str:
    return fault_of(lambda: body_track(read_bvh(skeleton(who)[0])))


def assert_read(who: Person, options: ReadOptions | None = None) -> None:
    text, truth = skeleton(who)
    track, reading = body_track(read_bvh(text), options or ReadOptions())
    assert reading.up == who.up
    np.testing.assert_allclose(track.points, truth, atol=1e-4)


@pytest.mark.parametrize("up", UP_AXES)
def test_any_axis_is_turned_up_without_a_mirror(up: str) -> None:
    turned = z_up(np.eye(3), up)
    axis = np.eye(3)["xyz".index(up[-1])] * (-1.0 if up[0] == "-" else 1.0)
    np.testing.assert_array_equal(z_up(axis, up), [0.0, 0.0, 1.0])
    assert np.linalg.det(turned) == pytest.approx(1.0)


@pytest.mark.parametrize("bend", [0.0, 30.0, 47.0, 65.0, 90.0])
@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("heading", [-1.5708, 0.0, 0.9, 3.1])
def test_bent_person_with_legs_stands_upright(bend: float, up: str, heading: float) -> None:
    assert_read(Person(bend=bend, up=up, heading=heading))
    assert_read(Person(bend=0.4 * bend, tilt=0.6 * bend, up=up, heading=heading))


@pytest.mark.parametrize(("up", "rest_up"), [("y", "z"), ("z", "y")])
@pytest.mark.parametrize("bend", [0.0, 40.0, 85.0])
def test_legs_go_before_a_rest_pose_that_lies_in_the_frame_of_the_motion(
    up: str, rest_up: str, bend: float
) -> None:
    assert_read(Person(up=up, rest_up=rest_up, bend=bend))


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("bend", [0.0, 65.0, 88.0])
@pytest.mark.parametrize("kind", ["twisted", "placed"])
def test_legs_tell_the_axis_where_the_rest_pose_does_not(
    up: str, bend: float, kind: str
) -> None:
    assert_read(replace(Person(up=up, bend=bend), **{kind: True}))


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("bend", [0.0, 30.0, 60.0])
def test_without_legs_rest_pose_and_trunk_tell_the_axis(up: str, bend: float) -> None:
    assert_read(Person(up=up, bend=bend, legs=False))


def test_without_legs_a_person_bent_down_may_stand_in_another_axis() -> None:
    bent = Person(bend=88.0, legs=False, heading=-1.5708)
    message = fault(bent)
    assert "fits y up by the motion (the trunk leans" in message
    assert "forward) and z up by the motion" in message
    assert "state up = y or z" in message
    assert_read(bent, ReadOptions(up="y"))


def test_without_legs_an_upright_person_with_a_lying_rest_pose_may_be_bent() -> None:
    upright = Person(up="z", rest_up="y", legs=False, heading=-1.5708)
    assert "z up by the motion (the trunk leans" in fault(upright)
    assert_read(upright, ReadOptions(up="z"))


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("heading", [-1.5708, 0.0, 1.2, 3.1])
@pytest.mark.parametrize(("thigh", "knee"), [(85.0, 85.0), (60.0, 110.0), (0.0, 88.0)])
@pytest.mark.parametrize("bend", [0.0, 35.0])
def test_person_who_sits_squats_or_kneels_is_upright(
    up: str, heading: float, thigh: float, knee: float, bend: float
) -> None:
    assert_read(Person(up=up, heading=heading, thigh=thigh, knee=knee, bend=bend))


@pytest.mark.parametrize(("up", "stated"), [("y", "-y"), ("z", "-z"), ("-y", "y")])
def test_axis_that_turns_the_person_head_down_cannot_be_stated(up: str, stated: str) -> None:
    with pytest.raises(BadRecording, match=f"up = {stated} turns the person head down"):
        body_track(read_bvh(skeleton(Person(up=up))[0]), ReadOptions(up=stated))


def test_axis_that_is_not_looked_for_is_named_and_can_be_stated() -> None:
    hanging = Person(up="-y")
    message = fault(hanging)
    assert "with y up" in message and "lower legs are" in message
    assert "state up = -y, which fits" in message
    assert_read(hanging, ReadOptions(up="-y"))
