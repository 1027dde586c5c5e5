import numpy as np
import pytest

from app.sim.cell_validation.reachability import Reach
from app.sim.cells.cell import Cell, load_cell
from app.sim.cells.parts import Obstacle
from app.sim.robot.ur10 import Robot
from tests.sim.mesh_reference import MeshReference


@pytest.fixture
def cell() -> Cell:
    return load_cell("shared-workspace")


def box(center: tuple[float, float, float], half: float = 0.1, yaw: float = 0.0) -> Obstacle:
    return Obstacle(id="box", label="Box", center=center, half_size=(half, half, half), yaw=yaw)


def test_contact_of_the_meshes_is_contact_of_the_capsules(cell: Cell) -> None:
    with_box = cell.model_copy(update={"obstacles": (box((0.4, 0.5, 0.4), yaw=0.5),)})
    reach, meshes = Reach(with_box), MeshReference(with_box)
    rng, kinds = np.random.default_rng(3), set()
    for q in rng.uniform(cell.robot.q_min, cell.robot.q_max, (400, 6)):
        found = {one.kind for one in meshes.contacts(q)}
        own = {one.kind for one in reach.contacts(q)}
        kinds |= own
        assert "self" not in found or own
        assert "cell" not in found or own & {"table", "obstacle"}
    assert kinds == {"self", "table", "obstacle"}


def test_configuration_found_reaches_its_point_inside_the_limits(cell: Cell) -> None:
    reach, robot = Reach(cell), Robot(cell.robot.tool_length)
    assert cell.goal_region is not None
    for point in cell.goal_region.targets()[::7]:
        q = reach.any_configuration(point).q
        assert q is not None
        np.testing.assert_allclose(robot.tcp_pose(q)[:3, 3], point, atol=1e-3)
        assert (q >= cell.robot.q_min).all() and (q <= cell.robot.q_max).all()
        assert list(reach.contacts(q)) == []


def test_tilted_configuration_is_found_where_no_vertical_one_exists(cell: Cell) -> None:
    point = np.array([0.0, 0.9, 0.85])
    reach = Reach(cell)
    assert reach.tool_down(point).q is None
    assert reach.any_configuration(point).q is not None


@pytest.mark.parametrize(
    ("point", "reason"),
    [
        ((0.0, 1.32, 0.12), "too far from"),
        ((0.0, 0.1, 0.12), "too near to"),
        ((-0.15, -0.1, 0.2), "touches its upper arm"),
    ],
)
def test_point_out_of_reach_says_why(
    cell: Cell, point: tuple[float, float, float], reason: str
) -> None:
    found = Reach(cell).tool_down(np.array(point))
    assert found.q is None
    assert reason in found.reason


def test_point_farther_than_the_arm_is_refused_at_once(cell: Cell) -> None:
    assert "farther" in Reach(cell).any_configuration(np.array([0.0, 2.0, 0.1])).reason


def test_point_inside_an_obstacle_is_out_of_reach(cell: Cell) -> None:
    around = cell.model_copy(update={"obstacles": (box((0.1, 0.8, 0.3)),)})
    found = Reach(around).any_configuration(np.array([0.1, 0.8, 0.3]))
    assert found.q is None
    assert "touches the obstacle box" in found.reason


def test_obstacle_on_the_base_is_found_at_home(cell: Cell) -> None:
    pillar = cell.model_copy(update={"obstacles": (box((0.0, 0.0, 0.1)),)})
    found = list(Reach(pillar).contacts(np.array(cell.robot.home_q)))
    assert ("base", "obstacle", "box") in [(one.link, one.kind, one.other) for one in found]
