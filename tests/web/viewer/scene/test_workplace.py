import numpy as np
import viser

from app.sim.cells.cell import load_cell
from app.sim.cells.parts import Obstacle
from tests.web.conftest import node
from web.viewer.scene import workplace


def test_obstacles_stand_where_the_cell_has_them(server: viser.ViserServer) -> None:
    box = Obstacle(
        id="rack", label="Rack", center=(0.6, 0.1, 0.2), half_size=(0.1, 0.2, 0.3), yaw=1.0
    )
    cell = load_cell("shared-workspace").model_copy(update={"obstacles": (box,)})
    workplace.build(server, cell)
    handle = node(server, "/obstacles/rack")
    np.testing.assert_allclose(handle.position, [0.6, 0.1, 0.2])
    np.testing.assert_allclose(handle.wxyz, [np.cos(0.5), 0.0, 0.0, np.sin(0.5)], atol=1e-12)
    np.testing.assert_allclose(handle.dimensions, [0.2, 0.4, 0.6])
