import json
from collections.abc import Callable
from typing import Any

import pytest

from app.errors import Fault, InvalidInput
from app.sim.cell_validation.checks import check_cell, station_distance
from app.sim.cells.cell import load_cell, parse_definition
from app.sim.cells.parts import Station
from app.sim.sorting.batch import batch_in

Edit = Callable[[dict[str, Any]], object]


def faults_of(edit: Edit, name: str = "pick-and-place") -> list[Fault]:
    """The faults of a shipped cell after a change of its file."""
    definition = json.loads(json.dumps(load_cell(name).definition()))
    edit(definition)
    return check_cell(parse_definition(definition))


def box(center: list[float], half: list[float], name: str = "box") -> dict[str, Any]:
    return {"id": name, "label": "Box", "center": center, "half_size": half}


def station(**changes: Any) -> Edit:
    return lambda cell: cell["stations"][0].update(changes)


def robot(**changes: Any) -> Edit:
    return lambda cell: cell["robot"].update(changes)


def person(**changes: Any) -> Edit:
    return lambda cell: cell["people"][0].update(changes)


def obstacle(*boxes: dict[str, Any]) -> Edit:
    return lambda cell: cell.update(obstacles=list(boxes))


@pytest.mark.parametrize("chance", [0.99, 0.991, 0.999])
def test_cell_that_passes_can_be_sorted_in(chance: float) -> None:
    def edit(cell: dict[str, Any]) -> None:
        for one in cell["stations"]:
            if one["kind"] == "clutter":
                one["failure_probability"] = chance

    definition = load_cell("sorting-e0").definition()
    edit(definition)
    if chance <= 0.99:
        assert not faults_of(edit, "sorting-e0")
        batch_in(parse_definition(definition), 1, 0)
    else:
        assert "must lie in [0, 0.99]" in faults_of(edit, "sorting-e0")[0].text
        with pytest.raises(InvalidInput):
            batch_in(parse_definition(definition), 1, 0)


@pytest.mark.parametrize(
    ("edit", "place", "text"),
    [
        (station(position=[-500, 0.7, 0.12]), "stations.cube0.position[0]", "millimetres"),
        (station(position=[0.0, 0.1, 0.12]), "stations.cube0.position", "too near to it"),
        (station(position=[-0.3, 0.69, 0.12]), "stations.cube1.position", "at least 0.05 m"),
        (station(position=[-1.2, 0.2, 0.12]), "stations.cube0.position", "over the table"),
        (station(position=[-0.5, 0.7, -0.1]), "stations.cube0.position", "below the table"),
        (station(levels=3), "stations.cube0.levels", "belongs to a station of kind cluster"),
        (station(kind="clutter"), "stations.cube0.failure_probability", "is missing"),
        (station(id="cube1"), "stations.cube1.id", "given once, not 2 times"),
        (robot(home_q=[0, -2.3, -3.0, 0, 0, 0]), "robot.home_q[2]", "limits (-2.8, 2.8)"),
        (robot(home_q=[1, -0.1, 0.3, 0, -1.57, 0]), "robot.home_q", "collision-free"),
        (robot(q_max=[3.1, -3.4, 2.8, 6.2, 6.2, 6.2]), "robot.q_min[1]", "q_max[1] = -3.4"),
        (robot(q_max=[3.1, 0.2, 6.2, 6.2, 6.2, 6.2]), "robot.q_max[2]", "[-2.8, 2.8] rad"),
        (robot(qd_max=[2.2, 1, 1, 1, 1, 1]), "robot.qd_max[0]", "[0.01, 2.16] rad/s"),
        (robot(q_max=[180, 0.2, 2.8, 6.2, 6.2, 6.2]), "robot.q_max[0]", "degrees"),
        (robot(tool_length=120.0), "robot.tool_length", "millimetres"),
        (person(y_min=0.5), "people[0].y_min", "off the table"),
        (person(home=[0.0, 2.5, -1.57]), "people[0].home", "inside the walking area"),
        (person(home=[0.0, 1.45, -90.0]), "people[0].home[2]", "degrees"),
        (person(home=[0.0, 1.45, 1.57]), "people[0].home[2]", "the table is at -1.57 rad"),
        (person(home=[0.0, 1.45, 0.0]), "people[0].home[2]", "must look at the table"),
        (person(home=[0.0, 1.45, 3.1416]), "people[0].home[2]", "must look at the table"),
        (station(position=[-0.5, 0.7, 0.45]), "stations.cube0.position", "0.45 m below it"),
        (
            person(x_min=1.1, x_max=1.6, y_min=0.2, y_max=0.9, home=[1.3, 0.5, 3.1]),
            "people[0].y_min",
            "edge of the table with the greatest y",
        ),
        (station(position=[-0.5, 0.7, 0.05]), "stations.cube0.position", "room to grasp"),
        (person(x_min=0.8), "people[0].x_min", "less than x_max = 0.7"),
        (
            obstacle(box([0.0, 0.0, 0.2], [0.1, 0.1, 0.2])),
            "obstacles.box.center",
            "touch the robot in its home configuration",
        ),
        (
            obstacle(box([-0.5, 0.7, 0.1], [0.08, 0.08, 0.1])),
            "stations.cube0.position",
            "inside the obstacle box",
        ),
        (
            obstacle(box([-0.5, 0.85, 0.3], [0.05, 0.1, 0.02])),
            "stations.cube0.position",
            "touches the obstacle box",
        ),
        (
            obstacle(
                box([0.9, -0.3, 0.1], [0.05, 0.05, 0.1]),
                box([0.9, -0.32, 0.1], [0.05, 0.05, 0.1], "duplicate"),
            ),
            "obstacles.duplicate.center",
            "it overlaps box",
        ),
        (
            obstacle(box([0.0, 1.5, -0.5], [0.1, 0.1, 0.3])),
            "people[0].home",
            "inside the obstacle box",
        ),
    ],
)
def test_mistake_is_one_fault_with_place_and_reason(edit: Edit, place: str, text: str) -> None:
    faults = faults_of(edit)
    assert [fault.place for fault in faults] == [place], [fault.text for fault in faults]
    assert text in faults[0].text


def test_all_mistakes_are_reported_at_once() -> None:
    def edit(cell: dict[str, Any]) -> None:
        cell["robot"]["dt"] = 50.0
        cell["stations"][0]["position"] = [-500.0, 0.7, 0.12]
        cell["stations"][1]["position"] = cell["stations"][2]["position"]
        cell["people"][0]["y_min"] = 0.5

    assert {fault.place for fault in faults_of(edit)} == {
        "robot.dt",
        "stations.cube0.position[0]",
        "stations.cube2.position",
        "people[0].y_min",
    }


def test_cluster_whose_top_is_out_of_reach_names_the_level() -> None:
    def edit(cell: dict[str, Any]) -> None:
        cell["stations"][-1].update(levels=40, level_height=0.03)

    (fault,) = faults_of(edit, "sorting-e0")
    assert fault.place == "stations.blue.levels"
    assert "of 40 levels" in fault.text


def test_two_clusters_of_one_colour_are_refused() -> None:
    def edit(cell: dict[str, Any]) -> None:
        cell["stations"][-1]["colour"] = "red"

    assert [fault.place for fault in faults_of(edit, "sorting-e0")] == [
        "stations.red.colour",
        "stations.blue.colour",
    ]


@pytest.mark.parametrize(
    ("changes", "place", "text"),
    [
        ({"spacing": 0.3}, "goal_region.size[0]", "multiple of spacing"),
        ({"spacing": 0.02}, "goal_region.spacing", "at most 2000"),
        ({"center": [0.0, 1.4, 0.3]}, "goal_region.center", "of 54 are not"),
        ({"center": [0.0, 0.8, 0.1]}, "goal_region.center", "over the table top"),
    ],
)
def test_goal_region_must_be_a_grid_in_reach(
    changes: dict[str, Any], place: str, text: str
) -> None:
    faults = faults_of(lambda cell: cell["goal_region"].update(changes), "shared-workspace")
    assert faults[0].place == place
    assert text in faults[0].text


def test_cylinder_may_walk_through_the_table_but_not_backwards() -> None:
    (fault,) = faults_of(
        lambda cell: cell["people"][0].update(speed_min=1.0, speed_max=0.3), "shared-workspace"
    )
    assert fault.place == "people[0].speed_min"


def test_station_may_stand_on_an_obstacle_beside_the_table() -> None:
    def edit(cell: dict[str, Any]) -> None:
        cell["stations"][0]["position"] = [-1.05, 0.2, 0.12]
        cell["obstacles"] = [box([-1.15, 0.2, -0.4], [0.14, 0.2, 0.35])]

    assert faults_of(edit) == []


def test_empty_cell_needs_somewhere_to_go() -> None:
    (fault,) = faults_of(lambda cell: cell.update(stations=[]))
    assert "at least one station" in fault.rule


def test_distance_to_a_cluster_counts_all_its_levels() -> None:
    place = {"label": "x", "kind": "cube"}
    cube = Station(id="a", position=(0.3, 0.5, 0.3), **place)
    tower = Station(
        id="b",
        kind="cluster",
        label="b",
        position=(0.0, 0.5, 0.05),
        colour="red",
        levels=10,
        level_height=0.02,
    )
    assert station_distance(cube, tower) == pytest.approx((0.3**2 + 0.07**2) ** 0.5)


@pytest.mark.parametrize(
    ("z", "box_top", "text"),
    [
        (0.35, None, None),  # on the table, a high part
        (0.6, 0.4, None),  # on a box on the table
        (0.6, 0.1, "box ends 0.5 m below it"),
        (0.5, 0.0, "the table ends 0.5 m below it"),
    ],
)
def test_a_station_must_be_carried_by_what_is_below(
    z: float, box_top: float | None, text: str | None
) -> None:
    def edit(cell: dict[str, Any]) -> None:
        cell["stations"][0]["position"] = [-0.5, 0.5, z]
        if box_top:
            half = 0.5 * box_top
            cell["obstacles"] = [box([-0.5, 0.5, half], [0.08, 0.08, half])]

    rules = [one.text for one in faults_of(edit) if one.place == "stations.cube0.position"]
    carried = [one for one in rules if "carried" in one]
    assert len(carried) == (text is not None)
    assert text is None or text in carried[0]


def test_a_station_beside_the_table_below_a_box_is_not_carried_by_it() -> None:
    def edit(cell: dict[str, Any]) -> None:
        cell["stations"][0]["position"] = [-1.1, 0.2, 0.1]
        cell["obstacles"] = [box([-1.1, 0.2, 0.5], [0.05, 0.05, 0.05])]

    texts = [one.text for one in faults_of(edit) if one.place == "stations.cube0.position"]
    assert any("box lies above it" in one for one in texts)


@pytest.mark.parametrize("yaw", [-1.57, -0.4, -2.7, 4.71])
def test_a_worker_may_look_at_the_table_at_an_angle(yaw: float) -> None:
    assert faults_of(person(home=[0.3, 1.45, yaw])) == []
