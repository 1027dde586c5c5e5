import math

import numpy as np
import pytest

from app.errors import NotFound
from app.sim.cell_validation.checks import check_cell
from app.sim.cell_validation.reachability import Reach
from app.sim.cells.cell import (
    Cell,
    cell_names,
    lacks_for_pick,
    lacks_for_pick_episodes,
    load_cell,
    parse_definition,
)
from app.sim.cells.parts import Each, Obstacle, Within
from app.sim.human.kernels.kinematics import PELVIS_Z
from tests.sim.mesh_reference import MeshReference

SORTING = {"sorting-e0": (10, 2, 10), "sorting-e1": (20, 3, 20)}


def models(model: type) -> set[type]:
    """Every schema that a cell is made of."""
    found, waiting = set(), [model]
    while waiting:
        one = waiting.pop()
        if isinstance(one, type) and hasattr(one, "model_fields") and one not in found:
            found.add(one)
            waiting += [field.annotation for field in one.model_fields.values()]
        waiting += list(getattr(one, "__args__", ()))
    return found


@pytest.mark.parametrize("name", cell_names())
def test_shipped_cell_has_no_fault(name: str) -> None:
    assert check_cell(load_cell(name)) == []


def test_four_cells_are_shipped() -> None:
    assert cell_names() == ("pick-and-place", "shared-workspace", "sorting-e0", "sorting-e1")


def test_every_bounded_number_says_its_unit() -> None:
    for model in models(Cell):
        for name, field in model.model_fields.items():
            for rule in field.metadata:
                parts = rule.parts if isinstance(rule, Each) else (rule,)
                units = {part.unit for part in parts if isinstance(part, Within)} - {""}
                assert all(f"[{unit}]" in field.description for unit in units), (model, name)


def test_cell_of_the_source_stays_what_policies_were_trained_in() -> None:
    cell = load_cell("pick-and-place")
    assert cell.station("cube3").position == (0.10, 0.70, 0.12)
    assert cell.robot.home_q == (0.9927, -2.3261, 2.0802, -1.3249, -1.5708, 0.0)
    assert (cell.robot.dt, cell.robot.qd_max[0], cell.robot.qdd_max[0]) == (0.05, 0.5, 3.0)
    assert (cell.floor_z, cell.body[PELVIS_Z]) == (-0.75, pytest.approx(0.2))
    assert cell.human.home == (0.0, 1.45, -1.5708)
    assert cell.pick_stations == cell.stations


def test_shared_workspace_is_that_of_the_source() -> None:
    cell = load_cell("shared-workspace")
    region, (walker,) = cell.goal_region, cell.cylinders
    assert region is not None and region.counts() == (6, 3, 3)
    targets = region.targets()
    assert targets.shape == (54, 3)
    over_floor = targets - [0.0, 0.0, cell.floor_z]
    np.testing.assert_allclose(over_floor.min(axis=0), [-0.5, 0.6, 0.8], atol=1e-12)
    np.testing.assert_allclose(over_floor.max(axis=0), [0.5, 1.0, 1.2], atol=1e-12)
    assert walker.kind == "walker"
    assert (walker.x_min, walker.x_max, walker.y_min, walker.y_max) == (-2.0, 1.0, 0.5, 2.0)
    assert (cell.robot.dt, cell.robot.qd_max[0], cell.robot.qdd_max[0]) == (0.02, 1.0, 5.0)


@pytest.mark.parametrize("name", SORTING)
def test_sorting_cell_has_the_source_s_numbers(name: str) -> None:
    n_slots, n_clusters, n_levels = SORTING[name]
    cell = load_cell(name)
    assert len(cell.stations_of("clutter")) == n_slots
    clusters = cell.stations_of("cluster")
    assert len(clusters) == n_clusters
    assert {cluster.levels for cluster in clusters} == {n_levels}


@pytest.mark.parametrize("name", SORTING)
def test_labels_of_a_sorting_cell_name_slots_and_towers(name: str) -> None:
    cell = load_cell(name)
    slots = [station.label for station in cell.stations_of("clutter")]
    assert slots == [f"Slot {k}" for k in range(len(slots))]
    for tower in cell.stations_of("cluster"):
        assert tower.label == f"{tower.colour} tower".capitalize()


@pytest.mark.parametrize("name", SORTING)
def test_picks_fail_most_at_the_robot_s_base(name: str) -> None:
    clutter = load_cell(name).stations_of("clutter")
    distance = np.array([math.hypot(*station.position[:2]) for station in clutter])
    chance = np.array([station.failure_probability for station in clutter])
    expected = 0.4 * (distance.max() - distance) / np.ptp(distance)
    np.testing.assert_allclose(chance, expected, atol=5e-4)


def tower(station) -> Obstacle:
    """A full cluster of blocks with a side of 8 cm."""
    x, y, _ = station.position
    half = 0.5 * station.levels * station.level_height
    return Obstacle(
        id=station.id, label="tower", center=(x, y, half), half_size=(0.04, 0.04, half)
    )


@pytest.mark.parametrize("name", SORTING)
def test_every_clutter_cell_and_level_is_reached_beside_full_towers(name: str) -> None:
    cell = load_cell(name)
    meshes = MeshReference(cell)
    for station in cell.stations:
        others = tuple(tower(one) for one in cell.stations_of("cluster") if one != station)
        reach = Reach(cell.model_copy(update={"obstacles": others}))
        for point in station.points():
            found = reach.tool_down(point)
            assert found.q is not None, (station.id, point, found.reason)
            assert meshes.contacts(found.q) == []


def test_levels_of_a_cluster_stand_on_one_another() -> None:
    points = load_cell("sorting-e0").station("red").points()
    assert points.shape == (10, 3)
    np.testing.assert_allclose(np.diff(points, axis=0), np.tile([0, 0, 0.03], (9, 1)))


def test_definition_gives_the_same_cell_again() -> None:
    for name in cell_names():
        cell = load_cell(name)
        assert parse_definition(cell.definition()) == cell
        assert parse_definition(cell.definition()).sha256 == cell.sha256


def test_any_change_is_another_cell() -> None:
    cell = load_cell()
    slower = cell.robot.model_copy(update={"dt": 0.04})
    assert cell.model_copy(update={"robot": slower}).sha256 != cell.sha256


def test_identity_of_a_cell_is_no_part_of_its_data() -> None:
    cell = load_cell()
    fresh, identity = parse_definition(cell.definition()), cell.sha256
    assert "sha256" not in cell.model_dump()
    assert cell == fresh and fresh.sha256 == identity
    assert cell.model_copy(deep=True).sha256 == identity


def test_cell_without_a_worker_says_so() -> None:
    with pytest.raises(NotFound, match="no worker in the cell 'shared-workspace'"):
        _ = load_cell("shared-workspace").human


def test_only_a_cell_with_cubes_docks_and_a_worker_is_one_to_pick_in() -> None:
    assert lacks_for_pick(load_cell("pick-and-place")) is None
    assert "kind cube" in (lacks_for_pick(load_cell("sorting-e0")) or "")
    no_people = load_cell().model_copy(update={"people": ()})
    assert "kind worker" in (lacks_for_pick(no_people) or "")
    turned = (*load_cell().robot.home_q[:5], 1.0)
    robot = load_cell().robot.model_copy(update={"home_q": turned})
    other = load_cell().model_copy(update={"robot": robot})
    assert "home_q[5] = 0" in (lacks_for_pick(other) or "")
    assert lacks_for_pick_episodes(other.model_copy(update={"people": ()})) is not None


def test_unknown_cell_is_named_with_the_known_ones() -> None:
    with pytest.raises(NotFound, match="known: pick-and-place, shared-workspace"):
        load_cell("kitchen")
