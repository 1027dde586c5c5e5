import io

import numpy as np
import trimesh

from app.sim.cells.cell import load_cell
from app.sim.robot.ur10 import LINK_NAMES, package_dir
from web.viewer.robot.robot_body import gripper_body, gripper_finger, link_meshes


def bounds(glb: bytes) -> np.ndarray:
    return np.asarray(trimesh.load_scene(io.BytesIO(glb), file_type="glb").bounds)


def test_link_meshes_keep_the_size_of_the_files() -> None:
    folder = package_dir() / "example-robot-data/robots/ur_description/meshes/ur10/visual"
    upper_arm = trimesh.load_scene(folder / "upperarm.dae")
    assert np.allclose(bounds(link_meshes()["upper_arm_link"]), upper_arm.bounds, atol=1e-3)
    assert set(link_meshes()) == set(LINK_NAMES)


def test_gripper_ends_a_little_beyond_the_tcp_and_inside_the_tool_capsule() -> None:
    tool = load_cell().robot
    body = bounds(gripper_body(tool.tool_length, tool.tool_radius))
    finger = bounds(gripper_finger(tool.tool_length))
    assert body[1][2] < tool.tool_length
    assert tool.tool_length < finger[1][2] < tool.tool_length + tool.tool_radius
