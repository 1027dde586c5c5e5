"""The robot in the scene: link meshes placed from Pinocchio, and the gripper."""

import numpy as np
import viser

from app.sim.cells import Cell
from app.sim.robot import LINK_NAMES, Robot
from app.sim.shapes import load_robot_capsules
from web.capsules_view import CapsulesView
from web.poses import Vec, orientation
from web.robot_body import gripper_body, gripper_finger, link_meshes

OPEN, CLOSED = 0.044, 0.036
"""Half the distance of the fingers [m]; a cube's side lies between."""


class RobotView:
    """Draws one UR10; used by the live cell's thread only.

    Args:
        server: Where to draw.
        cell: Says which tool it carries.
    """

    def __init__(self, server: viser.ViserServer, cell: Cell) -> None:
        tool = cell.robot
        self._robot = Robot(tool.tool_length)
        self._drawn: Vec | None = None
        scene = server.scene
        scene.add_frame("/robot", show_axes=False)
        self._links = [
            scene.add_glb(f"/robot/{name}", link_meshes()[name]) for name in LINK_NAMES
        ]
        self._tool = scene.add_frame("/robot/tool", show_axes=False)
        scene.add_glb("/robot/tool/body", gripper_body(tool.tool_length, tool.tool_radius))
        finger = gripper_finger(tool.tool_length)
        self._fingers = (
            scene.add_glb("/robot/tool/finger_a", finger, position=(OPEN, 0.0, 0.0)),
            scene.add_glb(
                "/robot/tool/finger_b",
                finger,
                position=(-OPEN, 0.0, 0.0),
                wxyz=(0.0, 0.0, 0.0, 1.0),
            ),
        )

        self._closed = False
        self._capsules = CapsulesView(server, "/robot/shapes")
        self._shapes = load_robot_capsules(tool.tool_length, tool.tool_radius)
        for name, radius, p0, p1 in zip(
            self._shapes.name,
            self._shapes.radius,
            self._shapes.p0,
            self._shapes.p1,
            strict=True,
        ):
            self._capsules.add(name, float(radius), float(np.linalg.norm(p1 - p0)))

    def draw(self, q: Vec) -> None:
        """Show the robot at joint positions ``q`` [rad], shape (6,)."""
        if self._drawn is not None and np.array_equal(q, self._drawn):
            return
        self._drawn = q.copy()
        poses = self._robot.link_poses(q)
        for handle, turn, pose in zip(
            self._links, orientation(poses[:, :3, :3]), poses, strict=True
        ):
            handle.wxyz, handle.position = turn, pose[:3, 3]
        tcp = self._robot.tcp_pose(q)
        self._tool.wxyz = orientation(tcp[:3, :3])
        self._tool.position = tcp[:3, 3] - self._robot.tool_length * tcp[:3, 2]
        frames = poses[self._shapes.link]
        ends = np.stack([self._shapes.p0, self._shapes.p1], axis=1)
        self._capsules.place(
            np.einsum("nij,nkj->nki", frames[:, :3, :3], ends) + frames[:, None, :3, 3]
        )

    def show_capsules(self, visible: bool, touched: str | None) -> None:
        """Show or hide the simulator's capsules; those that touched stay in view, red."""
        self._capsules.show(visible, () if touched is None else touched.split(" and "))

    def grip(self, closed: bool) -> None:
        """Open or close the fingers."""
        if closed == self._closed:
            return
        self._closed = closed
        half = CLOSED if closed else OPEN
        self._fingers[0].position, self._fingers[1].position = (half, 0, 0), (-half, 0, 0)
