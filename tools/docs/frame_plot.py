"""Draw the coordinate frame: robot base, axes, table, floor and person.

    python -m tools.docs.frame_plot

Writes ``docs/img/frame.png`` for ``docs/http.md``: the cell ``pick-and-place`` from above and
from the side, with robot and person drawn as the capsules of the simulator.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from app.sim.cells.cell import Cell, load_cell
from app.sim.core.arrays import Vec
from app.sim.geometry.capsules import RADIUS, ends_of
from app.sim.human.kernels.kinematics import N_CAPSULES
from app.sim.human.model import rest_posture
from app.sim.robot.kernels.arm import new_robot_pose, place_robot
from app.sim.scene.scene import arm_of, people_geometry_of, people_of
from tools.arguments import parser_of
from tools.docs.results import IMAGES
from tools.docs.world.plots import BLUE, GREEN, GREY, LIGHT, ORANGE, RED, panels, save

IMAGE = IMAGES / "frame.png"
X, Y, Z = range(3)
NAMES, COLOURS = ("x", "y", "z"), (RED, GREEN, BLUE)
INK = "#374151"
AXIS_M = 0.45
"""Length of the drawn axes [m]."""


def frame(cell: Cell) -> Figure:
    """Draw a cell with one worker from above and from the side."""
    figure, axes = panels(1, 2, 4.6)
    above, side = axes[0]
    table, floor = cell.table, cell.floor_z
    width, depth = table.x_max - table.x_min, table.y_max - table.y_min
    above.add_patch(Rectangle((table.x_min, table.y_min), width, depth, fc=LIGHT, ec=GREY))
    corner = (table.y_min, -table.thickness)
    side.add_patch(Rectangle(corner, depth, table.thickness, fc=LIGHT, ec=GREY))
    side.axhline(floor, color=GREY, lw=1.5)
    for view, first, second in ((above, X, Y), (side, Y, Z)):
        for capsules, colour in ((_robot(cell), ORANGE), (_worker(cell), GREY)):
            for (start, end), radius in zip(*capsules, strict=True):
                view.fill(
                    *_outline(start[[first, second]], end[[first, second]], radius),
                    color=colour,
                    alpha=0.5,
                    lw=0,
                )
        _arrow(view, first, (AXIS_M, 0.0))
        _arrow(view, second, (0.0, AXIS_M))
        view.plot(0.0, 0.0, "o", ms=4, color=INK, zorder=6)
        view.set_aspect("equal")
    for tip in ((-AXIS_M, 0.0), (0.0, -AXIS_M)):
        style = {"arrowstyle": "-|>", "ls": ":", "color": INK}
        above.annotate("", tip, (0.0, 0.0), arrowprops=style)
    above.text(-0.5, 0.0, "x of base", color=INK, ha="right", va="center")
    above.text(0.05, -0.4, "y of base", color=INK)
    above.text(0.09, -0.12, "base_link", color=INK, weight="bold")
    above.text(0.4, 1.5, "person's side, +y", color=INK)
    side.text(-0.6, -0.17, "table top, z = 0", color=INK)
    side.text(-0.6, floor + 0.04, f"floor, z = {floor:g} m", color=INK)
    above.set(title="From above", xlabel="x [m]", ylabel="y [m]")
    side.set(title="From the right (+x)", xlabel="y [m]", ylabel="z [m]")
    above.set(xlim=(-1.3, 1.3), ylim=(-0.9, 1.9))
    side.set(xlim=(-0.7, 2.1), ylim=(-0.95, 1.5))
    return figure


def _arrow(view: Axes, axis: int, tip: tuple[float, float]) -> None:
    style = {"arrowstyle": "-|>", "color": COLOURS[axis], "lw": 2.2}
    view.annotate("", tip, (0.0, 0.0), arrowprops=style, zorder=5)
    place = (tip[0] + 0.05, tip[1] + 0.05)
    view.text(*place, NAMES[axis], color=COLOURS[axis], weight="bold", zorder=5)


def _outline(start: Vec, end: Vec, radius: float) -> Vec:
    """Return the outline of a capsule in a plane [m], shape (2, n)."""
    along = np.arctan2(*(end - start)[::-1])
    turn = np.linspace(0.5 * np.pi, 1.5 * np.pi, 24)
    halves = [(start, along + turn), (end, along + turn + np.pi)]
    return np.concatenate(
        [middle[:, None] + radius * np.stack([np.cos(a), np.sin(a)]) for middle, a in halves],
        axis=1,
    )


def _robot(cell: Cell) -> tuple[Vec, Vec]:
    arm = arm_of(cell)
    pose, n = new_robot_pose(arm), len(arm.link)
    place_robot(arm, arm.home, pose)
    return ends_of(pose.capsules, n), pose.capsules[RADIUS, :n]


def _worker(cell: Cell) -> tuple[Vec, Vec]:
    q = rest_posture(*cell.human.home)
    capsules = people_geometry_of(people_of(cell), q[None], np.zeros((0, 3))).capsules
    return ends_of(capsules, N_CAPSULES), capsules[RADIUS, :N_CAPSULES]


if __name__ == "__main__":
    parser_of(__doc__).parse_args()
    save(frame, IMAGE, load_cell("pick-and-place"))
