from functools import partial

import numpy as np
import pytest

from app.sim.human.model import JOINT_NAMES
from app.sim.mocap.csv_tables import read_csv
from tests.sim.recorded_person import csv_text, fault_of, working

Q = working(30)
TEXT = csv_text(Q)
fault = partial(fault_of, read_csv)


@pytest.mark.parametrize("degrees", [True, False])
def test_angles_are_read_in_the_declared_unit(degrees: bool) -> None:
    track = read_csv(csv_text(Q, degrees=degrees))
    np.testing.assert_allclose(track.q, Q, atol=1e-8)
    np.testing.assert_allclose(track.times, 0.02 * np.arange(30))
    assert not track.pelvis_z.any()


def test_columns_may_stand_in_any_order_and_carry_the_pelvis_height() -> None:
    order = [*reversed(JOINT_NAMES), "pelvis_z"]
    rows = [",".join(f"{one:.9f}" for one in (*row[::-1], -0.1)) for row in Q]
    text = "\n".join(["# angles = radians", "# rate_hz = 50", ", ".join(order), *rows])
    track = read_csv(text)
    np.testing.assert_allclose(track.q, Q, atol=1e-8)
    np.testing.assert_allclose(track.pelvis_z, -0.1)
    np.testing.assert_allclose(np.diff(track.times), 0.02)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("# angles = degrees\n", "", "angles must be declared in a comment"),
        ("= degrees", "= gradians", "angles = 'gradians' must be declared"),
        ("= degrees", "= radians", "looks like degrees"),
        ("elbow_r", "elbow", "line 2 lacks the columns elbow_r"),
        ("elbow_r", "elbow_l", "line 2 = 'elbow_l' is the name of two columns"),
        ("time", "thyme", "line 2 has unknown columns: thyme"),
        ("\n0.020000000,", "\n0.000000000,", "line 4, column time = 0 must be later"),
        ("\n0.020000000,", "\nsoon,", "line 4, column time = 'soon' must be a number"),
        ("\n0.020000000,", "\n", "line 4 = <18> must hold 19 values, one per column"),
        (TEXT[40:], "", "line 2 lacks the columns"),
        (TEXT, "# angles = degrees\n", "file holds no table"),
    ],
)
def test_fault_is_named_with_line_or_column(old: str, new: str, text: str) -> None:
    assert old in TEXT
    assert text in fault(TEXT.replace(old, new, 1))


def test_table_in_radians_that_says_degrees_is_refused() -> None:
    message = fault(csv_text(Q, degrees=False).replace("= radians", "= degrees"))
    assert "looks like radians" in message


@pytest.mark.parametrize("degrees", [True, False])
def test_wrapped_angles_are_continuous(degrees: bool) -> None:
    q = working(300)
    q[:, 2], q[:, 10] = np.linspace(1.0, 12.0, 300), 3.0 + 0.4 * np.sin(np.arange(300) / 20)
    wrapped = (q + np.pi) % (2.0 * np.pi) - np.pi
    wrapped[:, :2] = q[:, :2]
    found = read_csv(csv_text(wrapped, degrees=degrees)).q
    assert np.abs(np.diff(found, axis=0)).max() < 0.1
    turns = (found - q) / (2.0 * np.pi)
    turns[:, 2] -= np.round(turns[0, 2])
    np.testing.assert_allclose(turns, 0.0, atol=1e-8)


def with_rise(pelvis_z: np.ndarray) -> str:
    lines = csv_text(working(len(pelvis_z))).splitlines()
    rows = [f"{line},{z:.6f}" for line, z in zip(lines[2:], pelvis_z, strict=True)]
    return "\n".join([lines[0], f"{lines[1]},pelvis_z", *rows])


def test_pelvis_height_over_the_floor_is_refused() -> None:
    message = fault(with_rise(np.full(30, 0.93)))
    assert "column pelvis_z = 0.93 is the median rise" in message
    assert "looks like the height over the floor" in message


@pytest.mark.parametrize(
    ("pelvis_z", "metres"),
    [(np.full(30, -45.0), "-0.45"), (np.linspace(0.5, -1.5, 30), "-0.015")],
)
def test_rise_of_the_pelvis_in_centimetres_is_refused(
    pelvis_z: np.ndarray, metres: str
) -> None:
    message = fault(with_rise(pelvis_z))
    assert message.startswith(f"column pelvis_z = {pelvis_z.min():g} is the height relative")
    assert f"must be -1.2 to 2 m (looks like centimetres: in m that is {metres})" in message


def test_place_in_centimetres_is_refused_by_the_speed_of_the_pelvis() -> None:
    q = working(200)
    q[:, :2] = 100.0 * (q[:, :2] - q[:, :2].mean(axis=0))
    message = fault(csv_text(q))
    assert message.startswith("columns pelvis_x, pelvis_y = ")
    assert "is the median speed of the pelvis; must be at most 3 m/s" in message
    assert "looks like centimetres" in message


def test_pelvis_in_millimetres_is_refused() -> None:
    q = Q.copy()
    q[:, :2] *= 1000.0
    message = fault(csv_text(q))
    assert message.startswith("column pelvis_x")
    assert "looks like millimetres" in message


@pytest.mark.parametrize(
    ("unit", "dt"), [("milliseconds", 20.0), ("microseconds", 2e4), ("nanoseconds", 2e7)]
)
def test_times_in_another_unit_are_refused(unit: str, dt: float) -> None:
    assert f"looks like {unit}: in s that is 0.02" in fault(csv_text(Q, dt=dt))


def since_1970(text: str, per_second: float = 1.0) -> str:
    head, rows = text.splitlines()[:2], text.splitlines()[2:]
    cells = [row.split(",", 1) for row in rows]
    times = [f"{per_second * (1732650000.0 + float(time)):.6f}" for time, _ in cells]
    stamped = (f"{time},{rest}" for time, (_, rest) in zip(times, cells, strict=True))
    return "\n".join([*head, *stamped])


def test_times_that_count_from_1970_are_read() -> None:
    track = read_csv(since_1970(TEXT))
    np.testing.assert_allclose(track.times - track.times[0], 0.02 * np.arange(30), atol=1e-6)


def test_times_that_count_nanoseconds_from_1970_are_refused_with_the_unit() -> None:
    assert "looks like nanoseconds: in s that is 0.02" in fault(since_1970(TEXT, 1e9))


@pytest.mark.parametrize(
    "rate", ["", "# rate_hz = fast\n", "# rate_hz = 0\n", "# rate_hz = nan\n"]
)
def test_table_without_times_needs_a_rate(rate: str) -> None:
    text = "\n".join(line.partition(",")[2] for line in TEXT.splitlines()[1:])
    assert "rate_hz" in fault(f"# angles = degrees\n{rate}{text}")
