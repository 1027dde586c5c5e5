"""Goal of a reach cell in the scene: point, tolerance and handle for dragging.

Callbacks run on viser's event loop and only queue a command. A handle that is not held follows
the goal; one that is dragged out of the goal region returns to its boundary.
"""

import time
from collections.abc import Callable

import numpy as np
import viser

from app.live.reach.commands import MoveGoal, goal_box
from app.live.reach.snapshot import ReachSnapshot
from app.sim.cells.cell import Cell
from web.viewer.people.gizmos import HOLD_S, SETTLE_S
from web.viewer.people.mannequin import Rgb
from web.viewer.poses import Vec

POINT_M = 0.028
GOAL: Rgb = (11, 127, 119)
REACHED: Rgb = (38, 166, 104)


class GoalGizmo:
    """The goal and its handle; poses are written by the live cell's thread only."""

    def __init__(
        self, server: viser.ViserServer, cell: Cell, submit: Callable[[MoveGoal], object]
    ) -> None:
        scene, self._submit = server.scene, submit
        self._low, self._high = goal_box(cell)
        self._free_at = 0.0
        self._handle = scene.add_transform_controls(
            "/goal/handle",
            scale=0.26,
            line_width=2.5,
            disable_rotations=True,
            depth_test=False,
            opacity=0.85,
        )
        self._frame = scene.add_frame("/goal/place", show_axes=False)
        self._point = scene.add_icosphere(
            "/goal/place/point", POINT_M, GOAL, subdivisions=3, cast_shadow=False
        )
        self._around = scene.add_icosphere(
            "/goal/place/tolerance",
            1.0,
            GOAL,
            subdivisions=4,
            opacity=0.2,
            cast_shadow=False,
            receive_shadow=False,
        )

        @self._handle.on_update
        async def _(event: viser.TransformControlsEvent) -> None:
            self._free_at = time.monotonic() + (SETTLE_S if event.phase == "end" else HOLD_S)
            if event.phase != "start":
                self._submit(MoveGoal(position=self._inside(self._handle.position)))

    def _inside(self, position: Vec) -> tuple[float, float, float]:
        """Return the point of the goal region nearest to the handle [m]."""
        x, y, z = np.clip(position, self._low, self._high).tolist()
        return x, y, z

    def draw(self, view: ReachSnapshot, *, reached: bool) -> None:
        """Show the goal, and move the handle to it unless a visitor holds the handle."""
        color = REACHED if reached else GOAL
        self._frame.position = view.goal
        self._around.scale = view.tolerance
        self._point.color = self._around.color = color
        if time.monotonic() >= self._free_at:
            if np.abs(self._handle.position - view.goal).max() > 1e-3:
                self._handle.position = view.goal
