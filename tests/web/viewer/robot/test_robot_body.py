import io

import numpy as np
import trimesh

from app.sim.cells.cell import load_cell
from app.sim.robot.ur10 import LINK_NAMES, package_dir
from web.viewer.people import mannequin
from web.viewer.robot.robot_body import gripper_body, gripper_finger, link_meshes


def bounds(glb: bytes) -> np.ndarray:
    return np.asarray(trimesh.load_scene(io.BytesIO(glb), file_type="glb").bounds)


def test_link_meshes_keep_the_size_of_the_files() -> None:
    folder = package_dir() / "example-robot-data/robots/ur_description/meshes/ur10/visual"
    assert set(link_meshes()) == set(LINK_NAMES)
    for name, mesh in link_meshes().items():
        file = name.removesuffix("_link").replace("_", "")
        original = trimesh.load_scene(folder / f"{file}.dae")
        assert np.allclose(bounds(mesh), original.bounds, atol=1e-3), name


def test_robot_and_person_have_few_triangles() -> None:
    links = (
        trimesh.load_scene(io.BytesIO(glb), file_type="glb") for glb in link_meshes().values()
    )
    assert sum(scene.triangles.shape[0] for scene in links) < 30_000
    assert sum(len(part.surface.faces) for part in mannequin.parts()) < 50_000


def test_gripper_ends_a_little_beyond_the_tcp_and_inside_the_tool_capsule() -> None:
    tool = load_cell().robot
    body = bounds(gripper_body(tool.tool_length, tool.tool_radius))
    finger = bounds(gripper_finger(tool.tool_length))
    assert body[1][2] < tool.tool_length
    assert tool.tool_length < finger[1][2] < tool.tool_length + tool.tool_radius
