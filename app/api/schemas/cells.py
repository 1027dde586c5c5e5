"""A work cell as the service shows it."""

from typing import Any, Self

from pydantic import Field

from app.api.schemas.numbers import Answer
from app.sim.cases import CASES
from app.sim.cells import Cell


class CasePublic(Answer):
    """One case study of the cell."""

    id: str
    title: str
    text: str = Field(description="what happens, for people")
    goals: list[str] = Field(description="stations the robot may choose")
    expected: str = Field(description="the goal it should end at")


class CellPublic(Answer):
    """One work cell: the file's own content plus its case studies."""

    name: str
    title: str
    table: dict[str, Any] = Field(description="table top [m]")
    stations: list[dict[str, Any]] = Field(description="cubes and docks, positions [m]")
    robot: dict[str, Any] = Field(description="home, limits and tool [rad, rad/s, m]")
    human: dict[str, Any] = Field(description="where the person stands [m, rad]")
    cases: list[CasePublic]

    @classmethod
    def from_domain(cls, cell: Cell) -> Self:
        """Make it from the cell's data."""
        cases = [
            CasePublic(
                id=case.id,
                title=case.title,
                text=case.text,
                goals=list(case.goals),
                expected=case.expected,
            )
            for case in CASES
        ]
        return cls(**cell.model_dump(mode="json"), cases=cases)


class CellList(Answer):
    """All work cells."""

    items: list[CellPublic]
