import re
from dataclasses import replace

import numpy as np
import pytest

from app.errors import BadRecording
from app.sim.mocap.bvh import read_bvh
from app.sim.mocap.read_options import UNITS, ReadOptions
from app.sim.mocap.skeletons import body_track
from tests.sim.recorded_person import fault_of
from tests.sim.recorded_skeleton import Person, skeleton


def fault(who: Person, options: ReadOptions | None = None) -> str:
    return fault_of(lambda: body_track(read_bvh(skeleton(who)[0]), options or ReadOptions()))


def assert_read(who: Person, unit: str, options: ReadOptions | None = None) -> None:
    text, truth = skeleton(who)
    track, reading = body_track(read_bvh(text), options or ReadOptions())
    assert reading.unit == unit
    assert reading.stature == pytest.approx(who.stature, rel=0.05)
    np.testing.assert_allclose(track.points, truth, atol=2e-3)


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("stature", [1.05, 1.3, 1.72, 2.05])
@pytest.mark.parametrize("head", [True, False])
def test_child_and_giant_are_read_in_any_unit(unit: str, stature: float, head: bool) -> None:
    assert_read(Person(unit=UNITS[unit], stature=stature, head=head), unit)


def test_stature_between_a_child_and_a_giant_fits_two_units_and_is_refused() -> None:
    between = Person(unit=0.0254, stature=0.98)
    message = fault(between)
    assert "fits two units, inch (0.9" in message and "and cmu (2.1" in message
    assert "state unit = inch or cmu" in message
    assert_read(between, "inch", ReadOptions(unit="inch"))


@pytest.mark.parametrize("unit", [4.0, 0.12, 1e-4])
def test_skeleton_in_no_known_unit_is_refused_and_can_be_stated_as_a_number(
    unit: float,
) -> None:
    scaled = Person(unit=unit)
    message = fault(scaled)
    assert "must be 1.0 to 2.1 m in one of the units m, cm, mm" in message
    assert "state unit = metres per unit" in message
    assert_read(scaled, f"{unit}", ReadOptions(unit=f"{unit}"))


def test_stated_unit_that_makes_no_person_is_refused_with_the_stature() -> None:
    message = fault(Person(unit=0.01), ReadOptions(unit="m"))
    assert message.startswith("unit = m makes the person 17") and "0.5 to 3.0 m" in message


@pytest.mark.parametrize(("offset", "rule"), [(12.0, "clavicle_l"), (0.3, "forearm_l")])
def test_part_out_of_proportion_is_named(offset: float, rule: str) -> None:
    lines = skeleton(Person(unit=0.01))[0].splitlines()
    role = "LeftArm" if rule == "clavicle_l" else "LeftHand"
    at = lines.index(next(line for line in lines if line.endswith(f"JOINT {role}"))) + 2
    words = lines[at].split()
    lines[at] = " ".join([words[0], *(repr(offset * float(one)) for one in words[1:])])
    message = fault_of(lambda: body_track(read_bvh("\n".join(lines))))
    assert message.startswith(rule) and "for a stature of 1.7" in message


MIXED = [("cm", "m"), ("cm", "mm"), ("m", "cm"), ("inch", "cm"), ("cm", "inch"), ("mm", "m")]


@pytest.mark.parametrize(("unit", "root_unit"), MIXED)
@pytest.mark.parametrize("floor", [0.0, -1.0, 0.4])
def test_root_path_in_another_unit_is_refused_naming_both(
    unit: str, root_unit: str, floor: float
) -> None:
    mixed = Person(unit=UNITS[unit], root_unit=UNITS[root_unit], floor=floor)
    message = fault(mixed)
    assert message.startswith("height of the pelvis, by the root's path")
    assert f"m in {unit}, as the skeleton, or" in message and f"m in {root_unit}" in message
    assert "must fit the legs, which hold it" in message
    assert f"state root_unit = {unit} or" in message
    assert_read(mixed, unit, ReadOptions(root_unit=root_unit))
    assert_read(mixed, unit, ReadOptions(unit=unit, root_unit=root_unit))


@pytest.mark.parametrize(("unit", "root_unit"), MIXED)
def test_without_legs_the_height_over_the_floor_tells_another_unit(
    unit: str, root_unit: str
) -> None:
    mixed = Person(unit=UNITS[unit], root_unit=UNITS[root_unit], legs=False)
    assert f"m in {root_unit}" in fault(mixed)
    assert_read(mixed, unit, ReadOptions(root_unit=root_unit))


@pytest.mark.parametrize("legs", [True, False])
@pytest.mark.parametrize("floor", [-1.0, -0.5, 0.3])
def test_floor_need_not_be_at_zero(legs: bool, floor: float) -> None:
    high = Person(unit=0.01, floor=floor, legs=legs)
    assert_read(high, "cm")
    notes = body_track(read_bvh(skeleton(high)[0]))[1].notes
    assert any("zero is not the floor" in one for one in notes) != legs


def test_any_person_is_read_right_or_refused_with_what_is_meant() -> None:
    """Statures, postures, units, axes, floors and missing parts by chance."""
    rng = np.random.default_rng(26)
    n_read = 0
    for _ in range(120):
        unit, up = str(rng.choice(list(UNITS))), str(rng.choice(["y", "z"]))
        root = str(rng.choice([*UNITS, unit, unit, unit, unit, unit]))
        legs, bend, share = bool(rng.random() < 0.7), rng.uniform(0.0, 90.0), rng.random()
        thigh, knee = rng.choice([(0.0, 0.0), (0.0, 20.0), (60.0, 110.0), (85.0, 85.0)])
        known = legs or root == unit
        if not known:  # only the height of a standing person determines the unit
            thigh = knee = 0.0
        who = Person(
            stature=rng.uniform(1.05, 2.05),
            bend=bend * share,
            tilt=0.7 * bend * (1.0 - share),
            thigh=thigh,
            knee=knee,
            heading=rng.uniform(-np.pi, np.pi),
            floor=float(rng.choice([0.0, 0.0, -0.9, 0.3])) if known else 0.0,
            unit=UNITS[unit],
            root_unit=UNITS[root],
            up=up,
            rest_up=str(rng.choice(["", "", "y", "z"])),
            twisted=bool(rng.random() < 0.15),
            placed=bool(rng.random() < 0.15),
            legs=legs,
            head=bool(rng.random() < 0.5),
        )
        text, truth = skeleton(who)
        try:
            track, reading = body_track(read_bvh(text))
        except BadRecording as error:
            meant = {"unit": unit, "root_unit": root, "up": up}
            asked = re.match(r"state (\w+) = ([^;,]+)", hint := error.faults[0].hint)
            assert asked and meant[asked[1]] in asked[2].split(" or "), (who, hint)
            track, reading = body_track(read_bvh(text), ReadOptions(**meant))
        else:
            n_read += 1
            assert (reading.unit, reading.root_unit, reading.up) == (unit, root, up), who
        np.testing.assert_allclose(
            track.points, truth, atol=2e-3 * who.stature, err_msg=str(who)
        )
    assert n_read > 50


def test_walk_keeps_its_length() -> None:
    """A root in metres over a skeleton in cm used to walk 100 times too short."""
    mixed = Person(unit=0.01, root_unit=1.0)
    text, truth = skeleton(mixed)
    track, _ = body_track(read_bvh(text), ReadOptions(root_unit="m"))
    assert np.ptp(track.points[:, 0, 0]) == pytest.approx(np.ptp(truth[:, 0, 0]), rel=1e-3)
    assert np.ptp(truth[:, 0, 0]) > 0.1
    assert "height of the pelvis" in fault(replace(mixed, floor=-0.5))
