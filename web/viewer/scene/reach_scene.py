"""Scene of a reach cell: goal, targets, path of the tool, separation zone.

In the zone on the floor a person is nearer than the protective separation distance S_p. Its
colour and the ring around the robot's base show the speed override.
"""

import itertools
from collections import deque
from collections.abc import Callable

import numpy as np
import viser

from app.live.reach.commands import MoveGoal, goal_box
from app.live.safety.snapshot import SafetySnapshot
from app.live.snapshot import WorldSnapshot
from app.live.status_messages import percent_text
from app.sim.cells.cell import Cell
from app.sim.cells.colours import TARGET, ColourScale, Rgb, blend
from app.sim.core.arrays import Vec
from app.sim.reach.batch import goal_region_of
from app.sim.safety.separation_zone import N_DIRECTIONS
from web.viewer.people.pedestrians_view import PedestriansView
from web.viewer.scene.arc import Arc
from web.viewer.scene.goal_gizmo import GoalGizmo
from web.viewer.solid_meshes import fan

OVERRIDES: ColourScale = (
    (0.0, (214, 52, 46)),
    (0.5, (240, 176, 52)),
    (1.0, (38, 166, 104)),
)
"""Colour by override; the same as OVERRIDES in ``web/page/palette.js``."""
OFF: Rgb = (122, 142, 166)
EDGE: Rgb = (130, 146, 160)
DOT: Rgb = (150, 164, 178)
GAUGE_M, GAUGE_Z = 0.21, 0.012
N_GAUGE, N_TRAIL = 60, 90
TRAIL_M = 4e-3
"""Least length of a piece of the trail [m]."""
BACK: Rgb = (226, 230, 235)


def override_color(safety: SafetySnapshot) -> Rgb:
    """Return the colour of the override; grey while the safety layer is disabled."""
    return blend(OVERRIDES, safety.override) if safety.on else OFF


class ReachScene:
    """Draws goal, targets, trail and zone; used by the live cell's thread only."""

    def __init__(
        self, server: viser.ViserServer, cell: Cell, submit: Callable[[MoveGoal], object]
    ) -> None:
        self._pedestrians = PedestriansView(server, cell)
        self._goal = GoalGizmo(server, cell, submit)
        _add_targets(server, cell)
        self._zone = _Zone(server, cell)
        self._gauge = _Gauge(server)
        self._trail = _Trail(server)
        self._path = Arc(server, "/path", lift=0.05)

    def note(self, snapshot: WorldSnapshot) -> None:
        """Add a snapshot to the trail without drawing."""
        if snapshot.reach is not None:
            self._trail.note(snapshot)

    def draw(self, snapshot: WorldSnapshot) -> None:
        """Show a snapshot; sends only what changed."""
        view = snapshot.reach
        if view is None:
            return
        self._pedestrians.draw(snapshot)
        self._goal.draw(view, reached=snapshot.status == "reached")
        if snapshot.status == "moving":
            self._path.show(snapshot.tcp, view.goal)
        else:
            self._path.hide()
        self._trail.note(snapshot)
        self._zone.draw(snapshot.safety)
        self._gauge.draw(snapshot.safety)
        self._trail.draw()


class _Zone:
    """The separation zone on the floor."""

    def __init__(self, server: viser.ViserServer, cell: Cell) -> None:
        self._z = cell.floor_z + 0.005
        square = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
        self._area = server.scene.add_mesh_simple(
            "/zone/area",
            *fan(square, self._z),
            color=OFF,
            opacity=0.22,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )
        self._edge = server.scene.add_line_segments(
            "/zone/edge", np.zeros((N_DIRECTIONS, 2, 3)), OFF, thickness=0.016, visible=False
        )
        self._key: tuple[object, ...] = ()

    def draw(self, safety: SafetySnapshot) -> None:
        """Show the zone of this state."""
        visible = safety.person is not None
        self._area.visible = self._edge.visible = visible
        color, outline = override_color(safety), safety.zone
        key = (color, *np.round(outline[::9], 2).ravel().tolist())
        if not visible or key == self._key:
            return
        self._key = key
        vertices, faces = fan(outline, self._z)
        self._area.faces = faces.astype(np.uint32)
        self._area.vertices = vertices.astype(np.float32)
        self._area.color = color
        rim = np.column_stack([outline, np.full(len(outline), self._z + 0.003)])
        self._edge.points = np.stack([rim, np.roll(rim, -1, axis=0)], axis=1).astype(np.float32)
        self._edge.colors = np.full((len(rim), 2, 3), color, dtype=np.uint8)


class _Gauge:
    """Ring around the robot's base, filled in proportion to the override."""

    def __init__(self, server: viser.ViserServer) -> None:
        angles = -0.5 * np.pi - 2.0 * np.pi * np.arange(N_GAUGE + 1) / N_GAUGE
        rim = GAUGE_M * np.column_stack([np.cos(angles), np.sin(angles)])
        points = np.column_stack([rim, np.full(len(rim), GAUGE_Z)])
        self._ring = server.scene.add_line_segments(
            "/gauge/ring", np.stack([points[:-1], points[1:]], axis=1), OFF, thickness=0.03
        )
        self._text = server.scene.add_label(
            "/gauge/text",
            "",
            position=(0.0, -GAUGE_M - 0.1, 0.02),
            anchor="center-center",
            font_screen_scale=1.1,
        )

    def draw(self, safety: SafetySnapshot) -> None:
        """Show the override of this state."""
        colors = np.full((N_GAUGE, 2, 3), BACK, dtype=np.uint8)
        colors[: round(N_GAUGE * safety.override)] = override_color(safety)
        self._ring.colors = colors
        self._text.text = percent_text(safety.override) if safety.on else "no safety layer"


class _Trail:
    """Trail of the tool, coloured by the override at each position."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._points: deque[tuple[Vec, Rgb]] = deque(maxlen=N_TRAIL + 1)
        self._lines = server.scene.add_line_segments(
            "/trail/lines", np.zeros((N_TRAIL, 2, 3)), TARGET, thickness=0.012, visible=False
        )
        self._sent = 0
        self._n = 0

    def note(self, snapshot: WorldSnapshot) -> None:
        """Add the position of the tool."""
        tcp, points = np.array(snapshot.tcp), self._points
        assert snapshot.reach is not None
        if points and float(np.linalg.norm(tcp - points[-1][0])) > 0.3:
            points.clear()
        if not points or float(np.linalg.norm(tcp - points[-1][0])) > TRAIL_M:
            points.append((tcp, override_color(snapshot.safety)))
            self._n += 1

    def draw(self) -> None:
        """Show the recorded positions."""
        seen = len(self._points) > 1
        self._lines.visible = seen
        if not seen or self._sent == self._n:
            return
        self._sent = self._n
        first = [self._points[0]] * (N_TRAIL + 1 - len(self._points))
        noted = [*first, *self._points]
        places = np.array([place for place, _ in noted])
        colors = np.array([color for _, color in noted], dtype=np.float64)
        fresh = np.linspace(0.25, 1.0, len(colors))[:, None]
        faded = (fresh * colors + (1.0 - fresh) * np.array(BACK)).astype(np.uint8)
        self._lines.points = np.stack([places[:-1], places[1:]], axis=1).astype(np.float32)
        self._lines.colors = np.stack([faded[:-1], faded[1:]], axis=1)


def _add_targets(server: viser.ViserServer, cell: Cell) -> None:
    """Add the outline of the goal region and its targets."""
    low, high = goal_box(cell)
    corners = np.array(list(itertools.product((0, 1), repeat=3)))
    edges = [
        pair
        for pair in itertools.combinations(corners, 2)
        if np.abs(pair[0] - pair[1]).sum() == 1
    ]
    box = low + np.array(edges) * (high - low)
    server.scene.add_line_segments("/goals/box", box, EDGE, thickness=0.004)
    server.scene.add_point_cloud(
        "/goals/targets",
        goal_region_of(cell).targets().astype(np.float32),
        DOT,
        point_size=0.014,
        point_shape="circle",
        precision="float32",
        point_shading="flat",
    )
