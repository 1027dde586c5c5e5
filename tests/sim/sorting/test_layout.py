import numpy as np
import pytest

from app.errors import CheckpointMismatch
from app.live import command_checks
from app.live.factory import lacks_for_live, new_world
from app.live.pick.world import LivePickWorld
from app.live.sorting.world import LiveSortingWorld
from app.sim.cells.cell import lacks_for_pick, load_cell
from app.sim.robot.kernels import kinematics
from app.sim.scene.scene import arm_of
from app.sim.sorting.layout import (
    above,
    half_size,
    lacks_for_sorting,
    reaching_cell,
    require_workspace,
)


@pytest.mark.parametrize("name", ["sorting-e0", "sorting-e1"])
def test_shipped_sorting_cells_can_be_shown_live(name: str) -> None:
    cell = load_cell(name)
    assert lacks_for_sorting(cell) is None
    assert lacks_for_live(cell) is None
    assert len(command_checks.tests_of(cell)) == 6
    assert isinstance(new_world(cell, None, 1), LiveSortingWorld)


def test_other_cells_are_shown_by_their_own_world() -> None:
    cell = load_cell()
    assert isinstance(new_world(cell, None, 1), LivePickWorld)
    assert command_checks.tests_of(cell) == ()
    assert "clutter" in (lacks_for_sorting(cell) or "")


def test_pick_scenario_sees_clutter_as_cubes_and_towers_as_docks() -> None:
    cell = load_cell("sorting-e0")
    seen = reaching_cell(cell)
    assert lacks_for_pick(seen) is None
    assert (len(seen.stations_of("cube")), len(seen.stations_of("dock"))) == (10, 2)
    assert seen.station("slot3").position == pytest.approx((0.18, 0.45, 0.12))


@pytest.mark.parametrize("name", ["sorting-e0", "sorting-e1"])
def test_tool_reaches_over_every_block_and_level(name: str) -> None:
    cell = load_cell(name)
    arm = arm_of(cell)
    for station in cell.stations:
        points = np.array([above(point) for point in station.points()])
        _, reached = kinematics.ik_vertical_batch(arm.lengths, arm.limits, points)
        assert reached.all(), station.id


@pytest.mark.parametrize("name", ["sorting-e0", "sorting-e1"])
def test_largest_block_fits_into_its_cell(name: str) -> None:
    cell = load_cell(name)
    width = 2.0 * half_size(cell, 2, 3)[0]
    rows = [one.position for one in cell.stations_of("clutter")]
    gaps = [max(abs(a[0] - b[0]), abs(a[1] - b[1])) for a in rows for b in rows if a != b]
    assert width + 0.02 < min(gaps)


def test_policy_may_act_where_only_the_stations_differ() -> None:
    trained, cell = load_cell(), load_cell("sorting-e0")
    require_workspace(cell, trained)
    slower = cell.robot.model_copy(update={"qd_max": (0.4,) * 6})
    other = cell.model_copy(update={"robot": slower})
    with pytest.raises(CheckpointMismatch, match="has another robot"):
        require_workspace(other, trained)
