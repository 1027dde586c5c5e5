"""The robot in the scene: link meshes at the poses of Pinocchio, and gripper or magnet."""

import numpy as np
import viser

from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.robot.capsules import load_robot_capsules
from app.sim.robot.ur10 import LINK_NAMES, Robot
from web.viewer.capsules_view import CapsulesView
from web.viewer.poses import orientation
from web.viewer.robot.robot_body import gripper_body, gripper_finger, link_meshes, magnet_body
from web.viewer.solid_meshes import torus

LAMP = (38, 196, 182)
"""Colour of the ring that is shown while the magnet is on."""
OPEN, CLOSED = 0.044, 0.036
"""Half of the distance between the fingers, open and closed [m]."""


class RobotView:
    """Draws one UR10; used by the live cell's thread only."""

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
        self._fingers: tuple[viser.GlbHandle, ...] = ()
        self._lamp: viser.MeshHandle | None = None
        if cell.stations_of("clutter"):
            self._lamp = self._add_magnet(scene, cell)
        else:
            self._fingers = self._add_gripper(scene, cell)
        self.capsules = CapsulesView(server, "robot")
        """Its collision capsules."""
        shapes = load_robot_capsules(tool.tool_length, tool.tool_radius)
        self._shape_links, self._ends = shapes.link, np.stack([shapes.p0, shapes.p1], axis=1)
        self.capsules.fit(shapes.name, shapes.radius, self._ends)

    def _add_gripper(
        self, scene: viser.SceneApi, cell: Cell
    ) -> tuple[viser.GlbHandle, viser.GlbHandle]:
        length = cell.robot.tool_length
        scene.add_glb("/robot/tool/body", gripper_body(length, cell.robot.tool_radius))
        finger, turned = gripper_finger(length), (0.0, 0.0, 0.0, 1.0)
        return (
            scene.add_glb("/robot/tool/finger_a", finger, position=(OPEN, 0.0, 0.0)),
            scene.add_glb(
                "/robot/tool/finger_b", finger, position=(-OPEN, 0.0, 0.0), wxyz=turned
            ),
        )

    def _add_magnet(self, scene: viser.SceneApi, cell: Cell) -> viser.MeshHandle:
        length, radius = cell.robot.tool_length, cell.robot.tool_radius
        scene.add_glb("/robot/tool/body", magnet_body(length, radius))
        return scene.add_mesh_simple(
            "/robot/tool/lamp",
            *torus(0.8 * radius, 0.004),
            color=LAMP,
            cast_shadow=False,
            position=(0.0, 0.0, length - 0.022),
            visible=False,
        )

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
        frames = poses[self._shape_links]
        turned = np.einsum("nij,nkj->nki", frames[:, :3, :3], self._ends)
        self.capsules.place(turned + frames[:, None, :3, 3])

    def grip(self, closed: bool) -> None:
        """Open or close the fingers, or switch the magnet."""
        if self._lamp is not None:
            self._lamp.visible = closed
            return
        half = CLOSED if closed else OPEN
        for finger, side in zip(self._fingers, (half, -half), strict=True):
            finger.position = (side, 0, 0)
