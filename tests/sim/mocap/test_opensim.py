from functools import partial

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.sim.core.arrays import Vec
from app.sim.human.anthropometry import MEDIAN
from app.sim.human.model import body_frames
from app.sim.mocap.opensim import COORDINATES, read_opensim
from tests.sim.recorded_person import fault_of, opensim_text

TO_OURS = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""From OpenSim's x forward, y up, z right to x forward, y left, z up."""


def coordinates(n: int = 20, seed: int = 0) -> dict[str, Vec]:
    rng = np.random.default_rng(seed)
    waves = np.sin(np.linspace(0.0, 1.0, n)[:, None] + rng.uniform(0.0, 6.0, len(COORDINATES)))
    angles = dict(zip(COORDINATES, 0.4 * waves.T, strict=True))
    angles["elbow_flex_r"] += 0.8
    angles["elbow_flex_l"] += 0.8
    angles["pelvis_ty"] += 0.95
    return angles


fault = partial(fault_of, read_opensim)


@pytest.mark.parametrize("degrees", [True, False])
def test_every_body_is_turned_as_opensim_turns_it(degrees: bool) -> None:
    angles = coordinates()
    track = read_opensim(opensim_text(angles, degrees=degrees))
    for k in range(20):
        a = {name: float(column[k]) for name, column in angles.items()}
        frames = body_frames(track.q[k], MEDIAN.vector(0.0))
        trunk = [a[f"pelvis_{name}"] for name in ("tilt", "list", "rotation")]
        back = [a[f"lumbar_{name}"] for name in ("extension", "bending", "rotation")]
        torso = Rotation.from_euler("ZXY", trunk) * Rotation.from_euler("ZXY", back)
        for hand, mirror in (("r", 1.0), ("l", -1.0)):
            arm = [a[f"arm_{name}_{hand}"] for name in ("flex", "add", "rot")]
            arm[1:] = mirror * arm[1], mirror * arm[2]
            upper = torso * Rotation.from_euler("ZXY", arm)
            fore = upper * Rotation.from_euler("Z", a[f"elbow_flex_{hand}"])
            for name, turn in (("upper_arm", upper), ("forearm", fore)):
                expected = TO_OURS @ turn.as_matrix() @ TO_OURS.T
                found = frames[f"{name}_{hand}"][:3, :3]
                np.testing.assert_allclose(found, expected, atol=1e-7)


def test_pelvis_walks_where_opensim_says() -> None:
    angles = coordinates()
    track = read_opensim(opensim_text(angles))
    np.testing.assert_allclose(track.q[:, 0], angles["pelvis_tx"], atol=1e-8)
    np.testing.assert_allclose(track.q[:, 1], -angles["pelvis_tz"], atol=1e-8)
    np.testing.assert_allclose(track.pelvis_z, angles["pelvis_ty"], atol=1e-8)


def test_raised_arm_and_bent_back_have_the_signs_of_the_field() -> None:
    angles = {name: np.zeros(5) for name in COORDINATES}
    angles["arm_flex_r"][:] = 1.0  # forward
    angles["arm_add_l"][:] = -0.5  # away from the body
    angles["lumbar_extension"][:] = -0.3  # bent forward
    q = read_opensim(opensim_text(angles)).q[0]
    assert q[10] == pytest.approx(1.0) and q[15] == pytest.approx(0.5)
    assert q[3] == pytest.approx(0.3)


def test_columns_of_legs_are_passed_over() -> None:
    angles = coordinates()
    more = {"knee_angle_r": np.full(20, 3.0), **angles, "ground_force_vx": np.full(20, 7e4)}
    found = read_opensim(opensim_text(more, degrees=False))
    expected = read_opensim(opensim_text(angles, degrees=False))
    np.testing.assert_array_equal(found.q, expected.q)


TEXT = opensim_text(coordinates())


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("endheader", "end", "line 28 has no line endheader"),
        ("inDegrees=yes\n", "", "head, inDegrees must be declared"),
        ("inDegrees=yes", "inDegrees=maybe", "head, inDegrees = 'maybe' must be declared"),
        ("inDegrees=yes", "inDegrees=no", "looks like degrees"),
        ("nRows=20", "nRows=30", "must be the 30 that the head of the file states"),
        ("nRows=20", "nRows=0", "must be the 0 that the head of the file states"),
        ("nRows=20", "nRows=x", "head, nRows = 'x' must be a whole number"),
        ("nColumns=18", "nColumns=17", "line 8 = <18 columns> must be the nColumns=17"),
        ("arm_flex_r", "arm_r", "line 8 lacks the columns arm_flex_r"),
        ("\tarm_flex_r", "\tarm_flex_l", "is the name of two columns"),
        ("0.020000000\t", "", "line 10 = <17> must hold 18 values"),
        ("0.020000000\t", "x\t", "line 10, column time = 'x' must be a number"),
        ("0.020000000\t", "0.5\t", "line 11, column time = 0.04 must be later"),
        (TEXT[TEXT.index("endheader") + 9 :], "", "ends after endheader"),
    ],
)
def test_fault_is_named_with_line_or_column(old: str, new: str, text: str) -> None:
    assert old in TEXT
    assert text in fault(TEXT.replace(old, new, 1))


def test_radians_that_are_said_to_be_degrees_are_refused() -> None:
    text = opensim_text(coordinates(), degrees=False).replace("inDegrees=no", "inDegrees=yes")
    assert "looks like radians" in fault(text)


def test_pelvis_in_millimetres_is_refused() -> None:
    angles = coordinates()
    angles["pelvis_ty"] *= 1000.0
    assert "looks like millimetres" in fault(opensim_text(angles))


@pytest.mark.parametrize("height", [0.12, 0.45, 0.68, 0.95])
def test_pelvis_of_a_child_or_a_seated_person_in_centimetres_is_refused(height: float) -> None:
    angles = coordinates()
    for name in ("pelvis_tx", "pelvis_tz"):
        angles[name][:] = 0.0
    angles["pelvis_ty"][:] = height
    assert read_opensim(opensim_text(angles)).pelvis_z[0] == pytest.approx(height)
    angles["pelvis_ty"] *= 100.0
    message = fault(opensim_text(angles))
    assert (
        f"column pelvis_ty = {100.0 * height:g} is the median height of the pelvis" in message
    )
    assert f"within 3 m of zero (looks like centimetres: in m that is {height:g})" in message


def test_place_in_centimetres_is_refused_by_the_speed_of_the_pelvis() -> None:
    angles = coordinates()
    for name in ("pelvis_tx", "pelvis_tz"):
        angles[name] *= 100.0
    message = fault(opensim_text(angles))
    assert message.startswith("columns pelvis_tx, pelvis_ty, pelvis_tz = ")
    assert "is the median speed of the pelvis" in message


def with_names(text: str, renamed: dict[str, str]) -> str:
    """Rename columns of a file."""
    lines = text.splitlines()
    k = lines.index("endheader") + 1
    lines[k] = "\t".join(renamed.get(name, name) for name in lines[k].split("\t"))
    return "\n".join(lines) + "\n"


def paths(ending: str = "/value") -> dict[str, str]:
    return {name: f"/jointset/joint_of_{name}/{name}{ending}" for name in COORDINATES}


@pytest.mark.parametrize(
    "renamed",
    [
        paths(),
        paths("|value"),
        paths(""),
        {name: f"ground_pelvis/{name}/value" for name in COORDINATES},
        {name: name.upper() for name in COORDINATES},
        {name: name.replace("_", "-") for name in COORDINATES},
        {
            "lumbar_extension": "L5_S1_Flex_Ext",
            "lumbar_bending": "L5_S1_Lat_Bending",
            "lumbar_rotation": "L5_S1_axial_rotation",
        },
    ],
    ids=["states", "outputs", "joints", "short", "capitals", "hyphens", "lowest level"],
)
@pytest.mark.parametrize("degrees", [True, False])
def test_coordinates_go_by_the_names_of_other_versions(
    renamed: dict[str, str], degrees: bool
) -> None:
    angles = coordinates()
    found = read_opensim(with_names(opensim_text(angles, degrees=degrees), renamed))
    expected = read_opensim(opensim_text(angles, degrees=degrees))
    np.testing.assert_allclose(found.q, expected.q, atol=1e-12)


@pytest.mark.parametrize("separator", [",", ", ", "  ", "\t", " \t"])
def test_table_may_be_separated_by_commas_or_blanks(separator: str) -> None:
    found = read_opensim(TEXT.replace("\t", separator))
    np.testing.assert_array_equal(found.q, read_opensim(TEXT).q)


def moco_text(more: dict[str, Vec]) -> str:
    """A solution as Moco writes it: its own head, no counts, states and what is beside them."""
    text = opensim_text(coordinates() | more, degrees=False)
    lines = with_names(text, paths()).splitlines()
    head = ["inDegrees=no", "num_controls=2", "num_multipliers=1", "num_states=20"]
    head += ["objective=0.009539", "success=true", "DataType=double", "version=3"]
    return "\n".join([*head, *lines[lines.index("endheader") :]]) + "\n"


def test_solution_of_moco_is_read_without_speeds_controls_and_multipliers() -> None:
    huge, nothing = np.full(20, 7e4), np.full(20, np.nan)
    more = {
        "/jointset/elbow_r/elbow_flex_r/speed": huge,
        "/jointset/elbow_r/elbow_flex_r/accel": huge,
        "/forceset/soleus_r/activation": huge,
        "/forceset/elbow_flex_r": huge,  # an actuator called as its coordinate
        "lambda_cid3_p0": nothing,
        "gamma_cid3_p0": nothing,
    }
    found = read_opensim(moco_text(more))
    np.testing.assert_allclose(found.q, read_opensim(TEXT).q, atol=1e-7)
    assert found.missing == ()


def test_row_that_lacks_a_coordinate_is_left_out_and_named() -> None:
    angles = coordinates()
    angles["arm_rot_l"][4:6] = np.nan
    found = read_opensim(opensim_text(angles))
    np.testing.assert_array_equal(found.frames, np.delete(np.arange(20), [4, 5]))
    (gap,) = found.missing
    assert (gap.first, gap.last, gap.reason) == (4, 5, "no value of arm_rot_l")


def test_spine_that_bends_level_by_level_is_composed() -> None:
    angles = coordinates()
    a = {name: angles.pop(name) for name in list(angles) if name.startswith("lumbar")}
    parts = {}
    for k, level in enumerate(("L5_S1", "L4_L5", "L1_T12")):
        share = (0.5, 0.3, 0.2)[k]
        for turn, name in zip(("Flex_Ext", "Lat_Bending", "axial_rotation"), a, strict=True):
            parts[f"{level}_{turn}"] = share * a[name]
    found = read_opensim(opensim_text(angles | parts))
    for k in range(20):
        trunk = [angles[f"pelvis_{name}"][k] for name in ("tilt", "list", "rotation")]
        torso = Rotation.from_euler("ZXY", trunk)
        for level in ("L5_S1", "L4_L5", "L1_T12"):
            turns = [one[k] for name, one in parts.items() if name.startswith(level)]
            torso = torso * Rotation.from_euler("ZXY", turns)
        expected = TO_OURS @ torso.as_matrix() @ TO_OURS.T
        frames = body_frames(found.q[k], MEDIAN.vector(0.0))
        np.testing.assert_allclose(frames["torso"][:3, :3], expected, atol=1e-7)


def test_shoulder_by_plane_and_elevation_is_turned_as_opensim_turns_it() -> None:
    angles = {name: one for name, one in coordinates(200).items() if "arm" not in name}
    t = np.linspace(0.0, 1.0, 200)
    for hand, plane in (("r", 1.4 * t - 0.2), ("l", 1.2 - 0.5 * t)):
        angles[f"sh_plane_elev_{hand}"] = plane
        angles[f"sh_elev_{hand}"] = 0.2 + 1.8 * t  # past the horizontal
        angles[f"sh_axial_rot_{hand}"] = 0.5 - t
        angles[f"sh_tx_{hand}"] = 0.01 * t
    q = read_opensim(opensim_text(angles)).q
    assert np.abs(np.diff(q, axis=0)).max() < 0.2  # no leap between equal triples
    for k in range(0, 200, 20):
        a = {name: float(column[k]) for name, column in angles.items()}
        frames = body_frames(q[k], MEDIAN.vector(0.0))
        for hand, mirror in (("r", 1.0), ("l", -1.0)):
            axial = mirror * a[f"sh_axial_rot_{hand}"] * np.array([-0.0846, 0.9947, -0.0584])
            shoulder = (
                Rotation.from_euler("y", mirror * a[f"sh_plane_elev_{hand}"])
                * Rotation.from_euler("x", -mirror * a[f"sh_elev_{hand}"])
                * Rotation.from_rotvec(axial)
            )
            torso = TO_OURS.T @ frames["torso"][:3, :3] @ TO_OURS
            expected = TO_OURS @ torso @ shoulder.as_matrix() @ TO_OURS.T
            found = frames[f"upper_arm_{hand}"][:3, :3]
            np.testing.assert_allclose(found, expected, atol=1e-4)


def test_arm_that_is_raised_in_its_plane_points_there() -> None:
    angles = {name: np.zeros(5) for name in COORDINATES if not name.startswith("arm")}
    for hand in "rl":
        for name in ("plane_elev", "elev", "axial_rot"):
            angles[f"sh_{name}_{hand}"] = np.zeros(5)
    angles["sh_elev_r"][:] = 1.0  # to the side
    angles["sh_elev_l"][:] = 1.0
    angles["sh_plane_elev_l"][:] = np.pi / 2.0  # to the front
    q = read_opensim(opensim_text(angles)).q[0]
    np.testing.assert_allclose(q[10:13], [0.0, 1.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(q[14:16], [1.0, 0.0], atol=1e-6)


@pytest.mark.parametrize(
    ("renamed", "text"),
    [
        ({"elbow_flex_r": "elbow_flexion_r"}, "name map elbow_flexion_r=elbow_flex_r)"),
        ({"arm_flex_l": "arm_flexion_left"}, "arm_flexion_left=arm_flex_l"),
        ({"pelvis_tilt": "pelvic_tilt"}, "pelvic_tilt=pelvis_tilt"),
        ({"lumbar_bending": "lumbar_bend"}, "lumbar_bend=lumbar_bending"),
        ({"arm_flex_r": "shoulder_r_x"}, "other columns: shoulder_r_x; a name map says"),
        ({"elbow_flex_l": "x", "elbow_flex_r": "y"}, "other columns: y, x; a name map says"),
    ],
)
def test_column_that_is_nearly_known_is_named(renamed: dict[str, str], text: str) -> None:
    message = fault(with_names(TEXT, renamed))
    assert text in message and "full-body" not in message
    assert all(name in message for name in renamed)


def test_model_without_arms_is_refused_because_arms_are_needed() -> None:
    legs = {
        name: one
        for name, one in coordinates().items()
        if not name.startswith(("arm", "elbow"))
    }
    message = fault(opensim_text(legs | {"hip_flexion_r": np.zeros(20)}))
    assert "a full-body model with arms is needed" in message


@pytest.mark.parametrize("title", ["Speeds", "Accelerations"])
def test_file_of_speeds_is_not_taken_for_one_of_coordinates(title: str) -> None:
    message = fault(TEXT.replace("Coordinates", title))
    assert message.startswith(f"line 1 = '{title}' must be coordinates")


@pytest.mark.parametrize("head", ["", "nRows=0\n", "nRows=00\n"])
def test_table_without_rows_is_refused(head: str) -> None:
    names = TEXT.splitlines()[7]
    message = fault(f"{head}inDegrees=yes\nendheader\n{names}\n")
    assert message.startswith("frames = <0> must be at least 2 that have all values")
