"""Heights of what carries the points of a cell."""

import pytest

from app.sim.cells.cell import load_cell
from app.sim.cells.parts import Obstacle
from app.sim.cells.support import support_height

TABLE = load_cell("pick-and-place").table


@pytest.mark.parametrize(
    ("point", "height"),
    [
        ((0.0, 0.5, 0.1), 0.0),
        ((0.3, 0.7, 0.25), 0.2),
        ((0.3, 0.7, 0.1), 0.0),
        ((0.3, 0.82, 0.25), 0.2),
        ((0.42, 0.7, 0.25), 0.0),
        ((TABLE.x_max + 0.5, 0.5, 0.1), -0.1),
        ((TABLE.x_max + 2.0, 0.5, 0.1), 0.0),
    ],
)
def test_highest_top_below_a_point_carries_it(
    point: tuple[float, float, float], height: float
) -> None:
    shelf = Obstacle(
        id="shelf", label="Shelf", center=(0.3, 0.7, 0.1), half_size=(0.15, 0.1, 0.1), yaw=1.571
    )
    pedestal = Obstacle(
        id="pedestal",
        label="Pedestal",
        center=(TABLE.x_max + 0.5, 0.5, -0.3),
        half_size=(0.2, 0.2, 0.2),
    )
    cell = load_cell("pick-and-place").model_copy(update={"obstacles": (shelf, pedestal)})
    assert support_height(cell, point) == pytest.approx(height)
