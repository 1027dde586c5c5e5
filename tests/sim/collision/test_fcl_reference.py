"""The reference sees what it should see: known contacts, names and distances."""

import numpy as np
import pytest

from app.sim.cells.cell import Cell, load_cell
from app.sim.collision.fcl_reference import MeshContact, collision_mesh, make_capsule
from app.sim.human import model as human
from app.sim.robot.ur10 import LINK_NAMES, Robot
from tests.sim.mesh_reference import SELF_BODY_PAIRS, MeshReference


@pytest.fixture(scope="module")
def cell() -> Cell:
    return load_cell()


@pytest.fixture(scope="module")
def raw(cell: Cell) -> MeshReference:
    return MeshReference(cell)


@pytest.fixture(scope="module")
def hull(cell: Cell) -> MeshReference:
    return MeshReference(cell, "hull")


def random_pair(cell: Cell, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    q = rng.uniform(cell.robot.q_min, cell.robot.q_max)
    human_q = rng.uniform(human.Q_MIN, human.Q_MAX)
    human_q[:3] = rng.uniform([-0.7, 0.6, -np.pi], [0.7, 1.7, np.pi])
    return q, human_q


def test_home_beside_a_resting_person_touches_nothing(cell: Cell, raw: MeshReference) -> None:
    human_q = human.rest_posture(*cell.human.home)
    assert raw.contacts(np.array(cell.robot.home_q), human_q) == []


def test_hand_at_the_tool_is_reported_with_both_names(cell: Cell, raw: MeshReference) -> None:
    limits = np.array(cell.robot.q_min), np.array(cell.robot.q_max)
    q = Robot().ik_vertical(np.array([0.1, 0.7, 0.12]), *limits)
    assert q is not None
    rest = human.rest_posture(*cell.human.home)
    posture = human.reach("r", np.array([0.1, 0.74, 0.18]), rest, cell.body)
    assert MeshContact(kind="human", link="tool", body="hand_r") in raw.contacts(q, posture.q)


def test_arm_stretched_flat_down_hits_the_table(raw: MeshReference) -> None:
    contacts = raw.contacts(np.array([1.5, 0.1, 0.0, 0.0, 0.0, 0.0]))
    assert MeshContact(kind="cell", link="forearm_link", body="table") in contacts
    assert all(contact.link != "base_link" for contact in contacts)


def test_folded_wrist_brings_the_tool_into_the_forearm(raw: MeshReference) -> None:
    q = np.array([0.0, -1.5, 1.0, -1.5, 3.1, 0.0])
    found = [raw.contacts(q) for q[3] in np.linspace(-3.1, 3.1, 60)]
    assert any(one.kind == "self" for contacts in found for one in contacts)


def test_hulls_report_every_contact_of_the_raw_meshes(
    cell: Cell, raw: MeshReference, hull: MeshReference
) -> None:
    rng = np.random.default_rng(11)
    for _ in range(300):
        q, human_q = random_pair(cell, rng)
        assert set(raw.contacts(q, human_q)) <= set(hull.contacts(q, human_q))


def test_hull_distance_is_zero_exactly_in_contact(cell: Cell, hull: MeshReference) -> None:
    rng = np.random.default_rng(12)
    for _ in range(60):
        q, human_q = random_pair(cell, rng)
        touches = any(contact.kind == "human" for contact in hull.contacts(q, human_q))
        assert (hull.distance(q, human_q) < 1e-6) == touches


def test_adjacent_bodies_are_never_asked_about() -> None:
    for link, partners in SELF_BODY_PAIRS:
        following = LINK_NAMES[LINK_NAMES.index(link) + 1]
        assert following not in partners


def test_meshes_are_in_the_frames_of_their_links() -> None:
    bounds = collision_mesh("forearm_link").bounds
    assert bounds[0, 2] < 0.0 < 0.57 < bounds[1, 2] < 0.63


@pytest.mark.parametrize("down", [[0, 0, -0.3], [1e-9, 0, -0.3], [0, 0, 0], [0.2, -0.1, -0.05]])
def test_placed_capsule_lies_between_its_ends(down: list[float]) -> None:
    p0 = np.array([0.1, 0.2, 0.3])
    pose = make_capsule(0.05, p0, p0 + down).getTransform()
    axis = 0.5 * np.linalg.norm(down) * pose.getRotation()[:, 2]
    ends = {tuple(np.round(pose.getTranslation() + sign * axis, 7)) for sign in (-1, 1)}
    assert ends == {tuple(np.round(p0, 7)), tuple(np.round(p0 + down, 7))}
