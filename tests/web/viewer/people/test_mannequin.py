from pathlib import Path

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.human import model as human
from app.sim.human.anthropometry import MEDIAN, BodySize, percentile_body
from tools.model_mannequin import model
from web.viewer.people import mannequin, skeleton
from web.viewer.people.gait import Gait


def test_every_vertex_of_a_soft_part_is_held_by_its_bones() -> None:
    bones = skeleton.bind_bones()
    for part in mannequin.parts():
        if part.bone is None:
            assert np.allclose(sum(part.weights.values()), 1.0)
            assert set(part.weights) <= set(bones)
        else:
            assert part.bone in bones


def test_surfaces_are_closed_and_point_outward() -> None:
    for part in mannequin.parts():
        if part.name in ("vest", "stripes"):  # open where they lie on the jacket
            continue
        faces = part.surface.faces
        edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        _, uses = np.unique(edges, axis=0, return_counts=True)
        assert (uses == 2).all(), part.name
        a, b, c = (part.surface.vertices[faces[:, k]] for k in range(3))
        assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() > 0.0, part.name


def test_shipped_surfaces_are_what_the_script_models(tmp_path: Path) -> None:
    mannequin.save(model(), tmp_path / "fresh.npz")
    with np.load(tmp_path / "fresh.npz") as fresh:
        for part in mannequin.parts():
            surface = mannequin.load(part.name, fresh)
            assert surface.vertices.shape == part.surface.vertices.shape
            assert np.allclose(surface.vertices, part.surface.vertices, atol=1e-4)


def test_hands_of_the_mannequin_are_where_the_simulators_hands_are() -> None:
    cell = load_cell()
    q = human.rest_posture(*cell.human.home)
    target = np.array([0.1, 0.8, 0.2])
    q = human.solve_hands(q, cell.body, right=target).q
    gait = Gait(cell.floor_z)
    gait.follow(human.body_frames(q, cell.body)["pelvis"], 0.0)
    bones = skeleton.bones(q, cell.body, gait.feet)
    glove = next(part for part in mannequin.parts() if part.name == "hand_r")
    frame = bones["hand_r"]
    vertices = glove.surface.vertices @ frame[:3, :3].T + frame[:3, 3]
    palm = human.joint_points(q, cell.body)["hand_r"]
    assert np.linalg.norm(vertices - palm, axis=1).min() < 0.04
    assert np.linalg.norm(vertices.mean(axis=0) - palm) < 0.06


def test_feet_stand_still_for_a_small_sway_and_step_after_a_walk() -> None:
    gait, pelvis = Gait(0.0), np.eye(4)
    gait.follow(pelvis, 0.0)
    planted = {side: foot.copy() for side, foot in gait.feet.items()}
    pelvis[0, 3] = 0.05
    assert not gait.follow(pelvis, 0.05)
    assert all(np.array_equal(gait.feet[side], planted[side]) for side in planted)
    for _ in range(60):
        pelvis[0, 3] += 0.04
        gait.follow(pelvis, 0.05)
    for _ in range(20):
        gait.follow(pelvis, 0.05)
    for foot in gait.feet.values():
        assert abs(foot[0, 3] - pelvis[0, 3]) < 0.13
        assert foot[2, 3] == pytest.approx(skeleton.ANKLE_HEIGHT)


def test_legs_reach_from_hip_to_ankle_while_a_foot_swings() -> None:
    cell = load_cell()
    gait, q = Gait(cell.floor_z), human.rest_posture(0.0, 1.4, -1.57)
    for _ in range(80):
        q[0] += 0.02
        gait.follow(human.body_frames(q, cell.body)["pelvis"], 0.05)
        bones = skeleton.bones(q, cell.body, gait.feet)
        for side in skeleton.SIDES:
            shin = bones[f"shin_{side}"]
            ankle = shin[:3, 3] - skeleton.SHIN * shin[:3, 2]
            assert np.linalg.norm(ankle - bones[f"foot_{side}"][:3, 3]) < 0.06


SIZES = {
    "small": percentile_body(5.0),
    "tall": percentile_body(95.0),
    "tall, short arms, broad": percentile_body(95.0, 5.0, 95.0),
    "recorded": BodySize(trunk=0.5, upper_arm_r=0.33, upper_arm_l=0.31, clavicle_r=0.15),
}


def edges(faces: np.ndarray) -> np.ndarray:
    return np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)


def test_skin_of_the_median_person_is_the_model_itself() -> None:
    for part in mannequin.parts():
        if part.bone is None:
            skin = mannequin.fitted(part, MEDIAN.vector(-0.75))
            assert np.allclose(skin, part.surface.vertices, atol=1e-9), part.name


@pytest.mark.parametrize("name", SIZES)
def test_skin_of_another_size_is_stretched_evenly_and_nowhere_torn(name: str) -> None:
    size = SIZES[name].vector(-0.75)
    for part in mannequin.parts():
        if part.bone is not None:
            continue
        ends = edges(part.surface.faces)
        before = part.surface.vertices[ends]
        after = mannequin.fitted(part, size)[ends]
        longer = np.linalg.norm(after[:, 1] - after[:, 0], axis=1)
        longer -= 2.0 * np.linalg.norm(before[:, 1] - before[:, 0], axis=1)
        assert longer.max() < 1e-3, part.name


@pytest.mark.parametrize("name", SIZES)
def test_sleeves_and_trousers_end_at_wrists_and_ankles_of_any_size(name: str) -> None:
    size = SIZES[name].vector(0.0)
    bind, median = skeleton.bind_bones(size), skeleton.bind_bones()
    ends = {"jacket": ("hand_r", "hand_l"), "trousers": ("foot_r", "foot_l")}
    for part in mannequin.parts():
        for bone in ends.get(part.name, ()):
            gaps = [
                np.linalg.norm(vertices - bones[bone][:3, 3], axis=1).min()
                for vertices, bones in (
                    (part.surface.vertices, median),
                    (mannequin.fitted(part, size), bind),
                )
            ]
            assert gaps[1] == pytest.approx(gaps[0], rel=0.2, abs=0.01)


@pytest.mark.parametrize(("name", "expected"), [("small", 1.57), ("tall", 1.87)])
def test_mannequin_is_as_tall_as_the_person(name: str, expected: float) -> None:
    cell = load_cell()
    size = SIZES[name].vector(cell.floor_z)
    q, gait = human.rest_posture(*cell.human.home), Gait(cell.floor_z)
    girth = SIZES[name].girth
    gait.follow(human.body_frames(q, size)["pelvis"], 0.0, girth)
    bones = skeleton.bones(q, size, gait.feet)
    parts = {part.name: part.surface.vertices for part in mannequin.parts()}
    crown = parts["head"] * skeleton.scales(size)["head"] + bones["head"][:3, 3]
    sole = parts["shoe_r"] * girth + bones["foot_r"][:3, 3]
    assert sole[:, 2].min() == pytest.approx(cell.floor_z, abs=0.01)
    assert crown[:, 2].max() - cell.floor_z == pytest.approx(expected, abs=0.03)


def test_soles_stay_on_the_floor_while_the_person_grows() -> None:
    gait, pelvis = Gait(0.0), np.eye(4)
    gait.follow(pelvis, 0.0, 1.0)
    assert gait.follow(pelvis, 0.05, 1.1)
    for foot in gait.feet.values():
        assert foot[2, 3] == pytest.approx(1.1 * skeleton.ANKLE_HEIGHT)


def test_people_wear_vests_of_different_colours() -> None:
    vest = next(part for part in mannequin.parts() if part.name == "vest")
    assert len({mannequin.color_of(vest, id) for id in range(4)}) == 4
