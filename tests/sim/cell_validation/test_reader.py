import json
from collections.abc import Callable
from typing import Any

import pytest

from app.errors import BadCell
from app.sim.cell_validation import reader
from app.sim.cell_validation.reader import MAX_BYTES, MAX_FAULTS, read_cell
from app.sim.cells.cell import cell_names, load_cell


def text_of(edit: Callable[[dict[str, Any]], object]) -> bytes:
    definition = json.loads(json.dumps(load_cell().definition()))
    edit(definition)
    return json.dumps(definition).encode()


def faults_of(content: bytes) -> dict[str, str]:
    """The faults of a file, by place."""
    with pytest.raises(BadCell) as caught:
        read_cell(content)
    return {fault.place: fault.text for fault in caught.value.faults}


class CountedName(str):
    """A name that counts how often it is compared."""

    __slots__ = ()
    comparisons = 0
    __hash__ = str.__hash__

    def __eq__(self, other: object) -> bool:
        CountedName.comparisons += 1
        return str.__eq__(self, other)


def test_effort_to_find_repeated_keys_grows_with_their_number_only() -> None:
    names = [CountedName(k) for k in (*range(2000), 7, 7)]
    assert reader._pairs([(name, 0) for name in names]).repeated_keys == ("7",)
    assert CountedName.comparisons < 10 * len(names)


@pytest.mark.parametrize("name", cell_names())
def test_good_file_gives_its_cell(name: str) -> None:
    cell = load_cell(name)
    assert read_cell(json.dumps(cell.definition()).encode()) == cell


def test_file_with_a_byte_order_mark_is_read() -> None:
    assert read_cell(b"\xef\xbb\xbf" + text_of(lambda _: None)) == load_cell()


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (b"", "line 1, column 1"),
        (b'{"name": "x",\n "title": }', "line 2, column 11"),
        (b"\xff\xfe{}", "byte 0xff at 0"),
        (b"[1, 2]", "must be one JSON object"),
        (b"null", "must be one JSON object"),
        (b" " * (MAX_BYTES + 1), "must have at most 262144 bytes"),
        (b"[" * 100_000, "nested"),
        (b'{"a":' * 100 + b"1" + b"}" * 100, "nested"),
        (b'{"name": ' + b"9" * 5000 + b"}", "very long number"),
    ],
)
def test_what_is_no_cell_at_all_is_one_fault_of_the_file(content: bytes, text: str) -> None:
    faults = faults_of(content)
    assert list(faults) == ["file"]
    assert text in faults["file"]


@pytest.mark.parametrize(
    ("edit", "place", "text"),
    [
        (lambda c: c.pop("robot"), "robot", "is missing"),
        (lambda c: c.update(robot=7), "robot", "must be an object"),
        (lambda c: c.update(stations={}), "stations", "must be a list"),
        (lambda c: c["robot"].pop("dt"), "robot.dt", "is missing (control period [s])"),
        (lambda c: c["robot"].update(tool_lenght=1), "robot.tool_lenght", "tool_length meant"),
        (lambda c: c["table"].update(x_min="0"), "table.x_min", "must be a number"),
        (lambda c: c["table"].update(x_min=True), "table.x_min", "must be a number"),
        (lambda c: c["robot"].update(dt=float("nan")), "robot.dt", "finite"),
        (lambda c: c["robot"].update(dt=10**400), "robot.dt", "finite"),
        (lambda c: c["robot"].update(qd_max=[1] * 5), "robot.qd_max[5]", "is missing"),
        (lambda c: c["robot"].update(qd_max=[1] * 7), "robot.qd_max", "6 numbers, not 7"),
        (
            lambda c: c["stations"][0].update(kind="cup"),
            "stations.cube0.kind",
            "'cube', 'dock'",
        ),
        (lambda c: c["stations"][0].update(id="A b"), "stations.A b.id", "begin with a-z"),
        (lambda c: c["stations"].append(3), "stations[8]", "must be an object"),
        (lambda c: c["people"][0].update(kind="dog"), "people[0].kind", "worker, walker"),
        (lambda c: c["people"][0].pop("kind"), "people[0].kind", "is missing"),
        (lambda c: c["people"][0].pop("home"), "people[0].home", "is missing"),
        (lambda c: c.update(human={}), "human", '"kind": "worker"'),
        (lambda c: c.update(title="\ud800"), "title", "must be text"),
        (lambda c: c.update(title="a\x1b[31m"), "title", "without control characters"),
        (lambda c: c.update(title="a\n"), "title", "without control characters"),
        (lambda c: c["stations"][0].update(label="a\0"), "stations.cube0.label", "control"),
        (lambda c: c.update(name="Big Cell"), "name", "begin with a-z"),
    ],
)
def test_field_that_cannot_be_read_is_named(
    edit: Callable[[dict[str, Any]], object], place: str, text: str
) -> None:
    faults = faults_of(text_of(edit))
    assert text in faults[place]


def test_key_given_twice_is_named_with_its_place() -> None:
    content = text_of(lambda _: None).replace(b'"dt": 0.05', b'"dt": 0.05, "dt": 0.02')
    assert "is given twice" in faults_of(content)["robot.dt"]


def test_unreadable_parts_do_not_hide_the_faults_of_the_others() -> None:
    def edit(cell: dict[str, Any]) -> None:
        cell["stations"][0]["position"] = "here"
        cell["stations"][1]["position"] = [0.0, 700.0, 0.12]
        cell["robot"]["dt"] = None
        cell["robot"]["home_q"][1] = -133.0
        cell["people"][0]["y_min"] = 0.4
        cell["colour"] = "blue"

    assert set(faults_of(text_of(edit))) == {
        "stations.cube0.position",
        "stations.cube1.position[1]",
        "robot.dt",
        "robot.home_q[1]",
        "people[0].y_min",
        "colour",
    }


def test_endless_lists_give_an_answer_of_bounded_length() -> None:
    content = text_of(lambda cell: cell.update(stations=[1] * 50_000, **{"k" * 9: 1}))
    with pytest.raises(BadCell) as caught:
        read_cell(content)
    places = [fault.place for fault in caught.value.faults]
    assert places[0] == "stations"
    assert len(places) <= MAX_FAULTS


def test_long_names_and_numbers_give_an_answer_of_bounded_length() -> None:
    strings = {"n" * 100_000: ["\x01"] * 5_000}
    with pytest.raises(BadCell) as caught:
        read_cell(text_of(lambda cell: cell.update(strings)))
    assert len(str(caught.value.problem())) < 200_000
    with pytest.raises(BadCell) as caught:
        read_cell(text_of(lambda cell: cell["stations"][0].update(levels=10**4000)))
    assert len(str(caught.value.problem())) < 2_000


def test_error_carries_all_faults_as_data() -> None:
    with pytest.raises(BadCell, match="and 1 more") as caught:
        read_cell(text_of(lambda cell: cell["robot"].update(dt=50.0, tool_length=120.0)))
    problem: Any = caught.value.problem()
    assert problem["field"] == "robot.tool_length"
    assert [error["field"] for error in problem["errors"]] == ["robot.tool_length", "robot.dt"]
    assert "millimetres" in problem["errors"][0]["hint"]


def test_random_bytes_and_random_edits_never_do_more_than_name_faults() -> None:
    values: tuple[Any, ...] = (None, -1e308, "x", [], {}, [[]], True, 1e-9, [1, 2, 3], "\x00")
    base = load_cell("sorting-e0").definition()

    def broken(node: Any, count: list[int], target: int, value: Any) -> Any:
        count[0] += 1
        if count[0] == target:
            return value
        if isinstance(node, dict):
            return {k: broken(v, count, target, value) for k, v in node.items()}
        if isinstance(node, list):
            return [broken(v, count, target, value) for v in node]
        return node

    base = json.loads(json.dumps(base))
    for target in range(2, 130, 3):
        value = values[target % len(values)]
        content = json.dumps(broken(base, [0], target, value)).encode()
        try:
            read_cell(content)
        except BadCell as error:
            assert all(fault.rule for fault in error.faults)
