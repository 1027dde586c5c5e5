import subprocess
import sys

import numpy as np
import pytest
import trimesh

from web.viewer.solid_meshes import block, disc, rod, slab, torus

WITHOUT_EXTRAS = """
import sys
sys.modules["skimage"] = None
from app.sim.cells.cell import load_cell
from web.viewer.people import mannequin
from web.viewer.robot import robot_body
from web.viewer.scene import stations_view, workplace
cell = load_cell()
workplace.table_body(cell), workplace.table_trim(cell), robot_body.link_meshes()
robot_body.gripper_body(0.12, 0.04), robot_body.gripper_finger(0.12), mannequin.parts()
"""


@pytest.mark.parametrize(
    ("solid", "volume"),
    [
        (block((0.2, 0.1, 0.3), (1.0, 2.0, 3.0), 0.001), 0.006),
        (slab((2.0, 1.0, 0.05), (0.0, 0.0, 0.0), 0.03, 0.003), 0.1),
        (rod((0.0, 0.0, 0.5), 0.4, 0.1), np.pi * 0.01 * 0.4),
    ],
)
def test_solids_point_outward_and_have_their_volume(
    solid: trimesh.Trimesh, volume: float
) -> None:
    assert solid.volume == pytest.approx(volume, rel=0.02)


def test_normals_of_solids_agree_with_their_faces() -> None:
    for solid in (rod((0.0, 0.0, 0.0), 0.4, 0.1), block((0.1, 0.1, 0.1), (0, 0, 0), 0.005)):
        of_vertices = solid.vertex_normals[solid.faces].mean(axis=1)
        assert (np.einsum("ij,ij->i", of_vertices, solid.face_normals) > 0.9).all()


def test_disc_and_ring_have_the_radius_asked_for() -> None:
    vertices, faces = disc(0.3)
    assert np.linalg.norm(vertices, axis=1).max() == pytest.approx(0.3)
    assert trimesh.Trimesh(vertices, faces).face_normals[:, 2].min() > 0.99
    ring, _ = torus(0.3, 0.01)
    assert np.linalg.norm(ring[:, :2], axis=1).max() == pytest.approx(0.31, rel=1e-3)


def test_scene_is_built_without_the_development_extras() -> None:
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_EXTRAS], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "falling back" not in done.stderr
