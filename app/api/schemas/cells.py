"""Work cells as they are shown and posted."""

from typing import Any, Self

from pydantic import Field

from app.api.schemas.numbers import Answer
from app.live.command_checks import tests_of
from app.live.factory import lacks_for_live
from app.sim.cells.cell import Cell, cell_names, lacks_for_pick
from app.sim.pick.cases import cases_of


class CasePublic(Answer):
    """A scenario of the thesis in the cell."""

    id: str
    title: str
    text: str = Field(description="the scenario as text")
    goals: list[str] = Field(description="candidate stations")
    expected: str = Field(description="expected goal")


class SortingTestPublic(Answer):
    """A sorting test for a live cell."""

    id: str
    title: str
    text: str = Field(description="the test as text")


class CellPublic(Answer):
    """A work cell: its definition, identity and scenarios."""

    name: str
    title: str
    shipped: bool = Field(description="whether it is part of the service")
    sha256: str = Field(description="digest of its content")
    lacks_for_pick: str | None = Field(
        description="missing requirement of pick policies; null where complete"
    )
    lacks_for_live: str | None = Field(
        description="missing requirement of a live world; null where complete"
    )
    table: dict[str, Any] = Field(description="table top [m]")
    robot: dict[str, Any] = Field(description="home, limits and tool [rad, rad/s, m]")
    stations: list[dict[str, Any]] = Field(description="named places, positions [m]")
    goal_region: dict[str, Any] | None = Field(description="box of goals and its grid [m]")
    obstacles: list[dict[str, Any]] = Field(description="fixed boxes [m, rad]")
    people: list[dict[str, Any]] = Field(description="people and their places [m, rad]")
    safety: dict[str, Any] = Field(description="safety settings [m, m/s, s]")
    cases: list[CasePublic]
    sorting_tests: list[SortingTestPublic]

    @classmethod
    def from_domain(cls, cell: Cell) -> Self:
        """Return the schema of a cell."""
        tests = [
            {"id": one.name, "title": one.title, "text": one.text} for one in tests_of(cell)
        ]
        return cls.from_object(
            cell,
            **{"goal_region": None, **cell.definition()},
            shipped=cell.name in cell_names(),
            lacks_for_pick=lacks_for_pick(cell),
            lacks_for_live=lacks_for_live(cell),
            cases=cases_of(cell),
            sorting_tests=tests,
        )


class CellList(Answer):
    """All work cells."""

    items: list[CellPublic]


def cell_schema() -> dict[str, Any]:
    """Return the JSON schema of a posted cell, without references."""
    schema = Cell.model_json_schema()
    parts = schema.pop("$defs")

    def inlined(node: Any) -> Any:
        if isinstance(node, dict):
            if "$ref" in node:
                name = str(node["$ref"]).rpartition("/")[2]
                return inlined(
                    {**parts[name], **{k: v for k, v in node.items() if k != "$ref"}}
                )
            if "prefixItems" in node:  # a vector; its numbers are alike
                node = {**node, "items": node["prefixItems"][0]}
                del node["prefixItems"]
            # The mapping of a discriminator refers to the removed parts.
            return {k: inlined(v) for k, v in node.items() if k != "discriminator"}
        return [inlined(one) for one in node] if isinstance(node, list) else node

    found: dict[str, Any] = inlined(schema)
    return found
