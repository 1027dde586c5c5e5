"""Goal of a reach cell in the scene: point, tolerance and handle for dragging.

Callbacks run on viser's event loop and only queue a command. A handle that is not held follows
the goal; one that is dragged out of the goal region returns to its boundary.
"""

import time
from collections.abc import Callable

import viser

from app.live.reach.commands import MoveGoal, goal_box
from app.live.reach.snapshot import ReachSnapshot
from app.sim.cells.cell import Cell
from app.sim.cells.colours import TARGET, Rgb
from web.viewer.people.gizmos import clipped, move, release_time

POINT_M = 0.028
REACHED: Rgb = (38, 166, 104)


class GoalGizmo:
    """The goal and its handle; poses are written by the live cell's thread only."""

    def __init__(
        self, server: viser.ViserServer, cell: Cell, submit: Callable[[MoveGoal], object]
    ) -> None:
        scene = server.scene
        low, high = goal_box(cell)
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
            "/goal/place/point", POINT_M, TARGET, subdivisions=3, cast_shadow=False
        )
        self._around = scene.add_icosphere(
            "/goal/place/tolerance",
            1.0,
            TARGET,
            subdivisions=4,
            opacity=0.2,
            cast_shadow=False,
            receive_shadow=False,
        )

        @self._handle.on_update
        async def _(event: viser.TransformControlsEvent) -> None:
            self._free_at = release_time(event.phase)
            if event.phase != "start":
                submit(MoveGoal(position=clipped(self._handle.position, low, high)))

    def draw(self, view: ReachSnapshot, *, reached: bool) -> None:
        """Show the goal, and move the handle to it unless a visitor holds the handle."""
        color = REACHED if reached else TARGET
        self._frame.position = view.goal
        self._around.scale = view.tolerance
        self._point.color = self._around.color = color
        if time.monotonic() >= self._free_at:
            move(self._handle, view.goal)
