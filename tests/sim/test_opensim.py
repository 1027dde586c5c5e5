import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.errors import BadMotion
from app.sim.body_size import MEDIAN
from app.sim.human import body_frames
from app.sim.opensim import COORDINATES, read_opensim
from app.sim.ports import Vec
from tests.sim.recorded_person import opensim_text

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


def fault(text: str) -> str:
    with pytest.raises(BadMotion) as caught:
        read_opensim(text)
    return caught.value.faults[0].text


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
        ("nRows=20", "nRows=30", "must be the 30 that the head of the file promises"),
        ("nRows=20", "nRows=x", "head, nRows = 'x' must be a whole number"),
        ("nColumns=18", "nColumns=17", "line 8 = <18 columns> must be the nColumns=17"),
        ("arm_flex_r", "arm_r", "line 8 lacks the columns arm_flex_r"),
        ("\tarm_flex_r", "\tarm_flex_l", "is the name of two columns"),
        ("0.020000000\t", "", "line 10 = <17> must hold 18 numbers"),
        ("0.020000000\t", "x\t", "line 10, number 1 = 'x' must be a number"),
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
