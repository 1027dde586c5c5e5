from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from app.sim.human.model import JOINT_NAMES
from app.sim.mocap.csv_tables import CSV_COLUMNS, read_csv
from tests.sim.recorded_person import csv_text, fault_of, working

Q = working(30)
TEXT = csv_text(Q)
HEAD = TEXT.splitlines()[1]
fault = partial(fault_of, read_csv)


def each_row(change: Callable[[str], str], text: str = TEXT) -> str:
    """Change every line of the table and none of the declaration."""
    said, *table = text.splitlines()
    return "\n".join([said, *(change(line) for line in table)]) + "\n"


def semicolons(text: str = TEXT) -> str:
    return each_row(lambda line: line.replace(",", ";").replace(".", ","), text)


def quoted(line: str) -> str:
    return ",".join(f'"{cell}"' for cell in line.split(","))


def with_units(*units: str) -> str:
    return TEXT.replace(HEAD, f"{HEAD}\n{','.join(units)}")


WRITTEN = {
    "padded by a spreadsheet": TEXT.replace("degrees\n", "degrees" + 18 * "," + "\r\n"),
    "padded far beyond": each_row(lambda line: line + 500 * ","),
    "quoted names": TEXT.replace(HEAD, quoted(HEAD)),
    "single quotes": TEXT.replace(HEAD, HEAD.replace("elbow_r", "'elbow_r'")),
    "everything quoted": each_row(quoted).replace("# angles = degrees", '"# angles = degrees"'),
    "semicolons and decimal commas": semicolons(),
    "semicolons and points": each_row(lambda line: line.replace(",", ";")),
    "quoted decimal commas": each_row(lambda line: quoted(line).replace(".", ",")),
    "tabs": each_row(lambda line: line.replace(",", "\t")),
    "tabs and decimal commas": each_row(lambda x: x.replace(",", "\t").replace(".", ",")),
    "bars": each_row(lambda line: line.replace(",", "|")),
    "white space": each_row(lambda line: line.replace(",", "  ")),
    "spaces after commas": each_row(lambda line: line.replace(",", ", ")),
    "said separator": "sep=;\n" + semicolons(),
    "unnamed index": TEXT.replace(HEAD, f",{HEAD}").replace("\n0.", "\n7,0."),
    "index of pandas": TEXT.replace(HEAD, f"Unnamed: 0,{HEAD}").replace("\n0.", "\n7,0."),
    "column of frames": TEXT.replace(HEAD, f"Frame,{HEAD}").replace("\n0.", "\n7,0."),
    "empty rows around": TEXT.replace("degrees\n", f"degrees\n{18 * ','}\n")
    + f"{18 * ','}\n\n",
    "other case": TEXT.replace("elbow_r", "Elbow R").replace("time", "Time"),
    "hyphens": TEXT.replace("shoulder_r_flex", "shoulder-r-flex"),
    "units in brackets": TEXT.replace("elbow_r", "elbow_r [deg]").replace("time", "time (s)"),
    "row of units": with_units("s", "m", "m", *16 * ["deg"]),
    "row of units, some empty": with_units("[s]", "", "", *16 * ["°"]),
    "names as a comment": TEXT.replace(HEAD, f"# {HEAD}"),
    "index of R": TEXT.replace(HEAD, f'"",{quoted(HEAD)}').replace("\n0.", '\n"7",0.'),
    "declared with a colon": TEXT.replace("angles = degrees", "angles: degrees"),
    "minus sign of typography": TEXT.replace("-", "\u2212"),
}


@pytest.mark.parametrize("text", WRITTEN.values(), ids=WRITTEN.keys())
def test_table_is_read_however_it_is_written(text: str) -> None:
    assert text != TEXT
    track = read_csv(text)
    np.testing.assert_allclose(track.q, Q, atol=1e-8)
    np.testing.assert_allclose(track.times, 0.02 * np.arange(30))
    assert track.missing == () and track.n_frames == 30


def test_decimal_commas_may_have_exponents() -> None:
    def exponents(line: str) -> str:
        cells = line.split(",")
        if cells[0] == "time":
            return ";".join(cells)
        return ";".join(f"{float(cell):.9e}".replace(".", ",") for cell in cells)

    np.testing.assert_allclose(read_csv(each_row(exponents)).q, Q, atol=1e-8)
    text = each_row(exponents).splitlines()
    cells = text[5].split(";")
    cells[4] = "1,5e99"
    text[5] = ";".join(cells)
    assert "must be a finite number of at most" in fault("\n".join(text))


def test_decimal_sign_is_found_behind_rows_at_rest() -> None:
    rest = "# rate_hz = 50\n" + ";".join(JOINT_NAMES) + 60 * ("\n" + ";".join(18 * "0"))
    rows = [";".join(f"{one:.4f}".replace(".", ",") for one in row) for row in Q]
    track = read_csv("\n".join(["# angles = radians", rest, *rows]))
    np.testing.assert_allclose(track.q[60:], Q, atol=1e-4)


@pytest.mark.parametrize(
    ("more", "text"),
    [
        ("# angles = radians", "line 2, angles = 'radians' must be degrees, as angles is decl"),
        ("# rate_hz = 100", "rate_hz = '100' must be the rate of the column time, 50 Hz"),
        ("# rate_hz = 50\n# rate_hz = 60", "line 3, rate_hz = '60' must be 50"),
    ],
)
def test_declarations_that_contradict_are_refused(more: str, text: str) -> None:
    assert text in fault(TEXT.replace("degrees\n", f"degrees\n{more}\n"))


def test_declared_rate_beside_times_may_be_rounded_and_repeated() -> None:
    more = "degrees\n# rate_hz = 49.95\n# rate_hz = 49.95\n# by = a\n# by = b\n"
    np.testing.assert_allclose(read_csv(TEXT.replace("degrees\n", more)).q, Q, atol=1e-8)


def test_declared_rate_may_be_padded_and_have_a_decimal_comma() -> None:
    rows = [line.partition(",")[2] for line in TEXT.splitlines()[1:]]
    text = "\n".join(["# angles = degrees;;;", "# rate_hz = 12,5;;;", *rows])
    np.testing.assert_allclose(np.diff(read_csv(text).times), 0.08)


def test_units_of_all_angles_declare_them() -> None:
    text = with_units("s", "m", "m", *16 * ["deg"]).replace("# angles = degrees\n", "")
    np.testing.assert_allclose(read_csv(text).q, Q, atol=1e-8)
    mixed = with_units("s", "m", "m", "rad", *15 * ["deg"]).replace("# angles = degrees\n", "")
    assert "angles must be declared" in fault(mixed)


@pytest.mark.parametrize(
    ("units", "text"),
    [
        (
            ["ms", "m", "m", *16 * ["deg"]],
            "column time = 'ms' is the unit that the file states",
        ),
        (["s", "mm", "mm", *16 * ["deg"]], "column pelvis_x = 'mm'"),
        (["s", "m", "m", *16 * ["rad"]], "column pelvis_yaw = 'rad'"),
        (["soon", "", "", *16 * [""]], "column time = 'soon'"),
    ],
)
def test_unit_that_is_not_ours_is_refused(units: list[str], text: str) -> None:
    assert text in fault(with_units(*units))


@pytest.mark.parametrize(
    "word", ["", " ", "NaN", "nan", "NA", "n/a", "-", "#N/A", "#DIV/0!", "null", "--"]
)
@pytest.mark.parametrize("name", ["elbow_r", "time"])
def test_row_that_lacks_a_value_is_left_out_and_named(word: str, name: str) -> None:
    lines = TEXT.splitlines()
    for k in (10, 11, 20):
        cells = lines[k + 2].split(",")
        cells[HEAD.split(",").index(name)] = word
        lines[k + 2] = ",".join(cells)
    track = read_csv("\n".join(lines))
    left = np.delete(np.arange(30), [10, 11, 20])
    np.testing.assert_array_equal(track.frames, left)
    np.testing.assert_allclose(track.q, Q[left], atol=1e-8)
    np.testing.assert_allclose(track.times, 0.02 * left)
    spans = [(one.first, one.last, one.parts) for one in track.missing]
    assert spans == [(10, 11, (name,)), (20, 20, (name,))]
    assert track.missing[0].reason == f"no value of {name}"


def test_row_without_any_value_counts_where_a_rate_is_declared() -> None:
    rows = [line.partition(",")[2] for line in TEXT.splitlines()[1:]]
    rows[6] = 17 * ";"
    text = "# angles = degrees\n# rate_hz = 50\n" + "\n".join(rows).replace(",", ";")
    track = read_csv(text)
    np.testing.assert_allclose(track.times, 0.02 * np.delete(np.arange(30), 5))
    (gap,) = track.missing
    assert (gap.first, gap.last, len(gap.parts)) == (5, 5, 18)
    assert gap.reason.endswith("and 15 more")


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("elbow_r", "elbow_right", "name map elbow_right=elbow_r"),
        ("shoulder_r_abduct", "shoulder_r_abd", "shoulder_r_abd=shoulder_r_abduct"),
        ("abdomen_flex", "lumbar", "lacks the columns abdomen_flex"),
        ("time", "times", "has unknown columns: times (nearly known; if it is meant"),
        ("time", "heart", "has unknown columns: heart (other columns: heart; a name map"),
        ("elbow_l", "Elbow R", "'elbow_r' is the name of two columns"),
    ],
)
def test_column_that_is_nearly_known_is_named(old: str, new: str, text: str) -> None:
    assert text in fault(TEXT.replace(old, new, 1))


@pytest.mark.parametrize(
    "word", ["1.234,5", "1,234.5", "1 234,5", "1'234,5", "1_234", "1.234.567"]
)
def test_thousands_separators_are_refused_with_a_hint(word: str) -> None:
    lines = semicolons().splitlines()
    lines[5] = word + lines[5][lines[5].index(";") :]
    message = fault("\n".join(lines))
    assert message.startswith(f"line 6, column time = {word!r} must be a number")
    assert "without thousands separators" in message


@pytest.mark.parametrize("word", ["1,234.5", "1,234", "1_234", "1_234.5"])
def test_thousands_separators_beside_decimal_points_are_refused(word: str) -> None:
    lines = TEXT.splitlines()
    lines[5] = f'"{word}"' + lines[5][lines[5].index(",") :]
    assert "without thousands separators" in fault("\n".join(lines))


def test_decimal_commas_between_commas_are_reported() -> None:
    message = fault(each_row(lambda line: line.replace(".", ",")))
    assert "line 3 = <38> must hold 19 values" in message and "decimal commas?" in message


def test_index_column_without_a_name_is_reported() -> None:
    message = fault(TEXT.replace("\n0.", "\n7,0."))
    assert (
        "line 3 = <20> must hold 19 values" in message and "a column without a name?" in message
    )


@pytest.mark.parametrize("word", ["inf", "1e300", "-Infinity"])
def test_number_that_is_not_finite_is_no_missing_value(word: str) -> None:
    message = fault(TEXT.replace("\n0.020000000,", f"\n{word},"))
    assert f"line 4, column time = {word!r} must be a finite number" in message


def test_column_without_any_value_is_named() -> None:
    text = each_row(lambda line: line.rpartition(",")[0] + "," if line != HEAD else line)
    assert fault(text) == "column elbow_l has no value in any row"


def test_table_with_one_complete_row_is_refused() -> None:
    text = each_row(
        lambda line: f"{line[:0]},{line[12:]}" if line > "0.02" and "_" not in line else line
    )
    assert "frames = <1> must be at least 2 that have all values" in fault(text)


@pytest.mark.parametrize(
    "text",
    [
        "# angles = degrees\n" + ",".join(f"c{k}" for k in range(401)),
        "# angles = degrees\n" + 100_000 * "x,",
    ],
)
def test_too_many_columns_are_refused(text: str) -> None:
    assert "line 2 must have at most 400 columns" in fault(text)


def test_names_that_are_known_are_those_of_the_joints() -> None:
    assert set(CSV_COLUMNS) == {*JOINT_NAMES, "time", "pelvis_z"}
