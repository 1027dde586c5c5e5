"""Work cells as data: what stands where, and the limits that hold there (ARCHITECTURE).

A cell is a JSON file that a user may write; pydantic checks it, and an error names the field,
the value and the rule. Frame: the robot's base, x right, y toward the person, z up, table top
at z = 0. SI units, radians.

Source: thesis section 5.3.1 (``pick-and-place``); the coordinates, which it does not print, are
ours (METHOD 3.2).
"""

import json
from functools import cache
from importlib import resources
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from app.errors import NotFound
from app.sim.ports import Vec

Six = tuple[float, float, float, float, float, float]
Position = tuple[float, float, float]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


class _Data(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Table(_Data):
    """A rectangular table top; its upper face is the plane z = 0."""

    x_min: Finite = Field(description="left edge [m]")
    x_max: Finite = Field(description="right edge [m]")
    y_min: Finite = Field(description="edge behind the robot [m]")
    y_max: Finite = Field(description="edge on the person's side [m]")
    thickness: Positive = Field(description="thickness of the top [m]")
    height: Positive = Field(description="height of the top above the floor [m]")

    @model_validator(mode="after")
    def _edges_in_order(self) -> Self:
        if self.x_min >= self.x_max or self.y_min >= self.y_max:
            raise ValueError("table edges must satisfy x_min < x_max and y_min < y_max")
        return self


class Station(_Data):
    """A named place the robot's tool can be sent to."""

    id: str = Field(pattern=r"^[a-z][a-z0-9_-]{0,31}$", description="name in requests")
    kind: Literal["cube", "dock"] = Field(description="what stands there")
    label: str = Field(description="name for people")
    position: Position = Field(description="point the tcp must reach [m]")


class RobotMount(_Data):
    """The UR10 in this cell: home posture, limits and tool."""

    home_q: Six = Field(description="home posture [rad]")
    q_min: Six = Field(description="lower joint limits [rad]")
    q_max: Six = Field(description="upper joint limits [rad]")
    qd_max: Six = Field(description="joint speed limits [rad/s]")
    qdd_max: Six = Field(description="joint acceleration limits [rad/s^2]")
    tool_length: Positive = Field(description="from flange to tcp [m]")
    tool_radius: Positive = Field(description="radius of the tool's capsule [m]")
    dt: Positive = Field(description="control period [s]")

    @model_validator(mode="after")
    def _limits_in_order(self) -> Self:
        for joint, (low, home, high) in enumerate(
            zip(self.q_min, self.home_q, self.q_max, strict=True)
        ):
            if not low < home < high:
                raise ValueError(
                    f"home_q[{joint}] = {home} must lie inside ({low}, {high}) rad"
                )
        if min(self.qd_max) <= 0.0 or min(self.qdd_max) <= 0.0:
            raise ValueError("qd_max and qdd_max must be positive")
        return self


class HumanArea(_Data):
    """Where the person stands and how high the pelvis is."""

    home: Position = Field(description="pelvis x, y [m] and yaw [rad] when at rest")
    x_min: Finite = Field(description="walking area, left edge [m]")
    x_max: Finite = Field(description="walking area, right edge [m]")
    y_min: Finite = Field(description="walking area, edge at the table [m]")
    y_max: Finite = Field(description="walking area, far edge [m]")
    pelvis_height: Positive = Field(description="pelvis above the floor [m]")


class Cell(_Data):
    """One work cell."""

    name: str = Field(pattern=r"^[a-z][a-z0-9-]{0,63}$", description="name in requests")
    title: str = Field(description="name for people")
    table: Table
    stations: tuple[Station, ...] = Field(min_length=1)
    robot: RobotMount
    human: HumanArea

    @model_validator(mode="after")
    def _ids_are_unique(self) -> Self:
        ids = [station.id for station in self.stations]
        twice = sorted({name for name in ids if ids.count(name) > 1})
        if twice:
            raise ValueError(f"station ids must be unique, given twice: {', '.join(twice)}")
        return self

    @property
    def floor_z(self) -> float:
        """Height of the floor in the cell's frame [m]."""
        return -self.table.height

    @property
    def pelvis_z(self) -> float:
        """Height of the person's pelvis in the cell's frame [m]."""
        return self.floor_z + self.human.pelvis_height

    @property
    def station_ids(self) -> tuple[str, ...]:
        """Names of all stations, in order."""
        return tuple(station.id for station in self.stations)

    def positions(self) -> Vec:
        """Return the stations' positions [m], shape (n_stations, 3)."""
        return np.array([station.position for station in self.stations], dtype=np.float64)

    def station(self, name: str) -> Station:
        """Return one station by id.

        Raises:
            NotFound: The cell has no such station.
        """
        for station in self.stations:
            if station.id == name:
                return station
        raise NotFound("station", name, self.station_ids)


def cell_names() -> tuple[str, ...]:
    """Return the names of the shipped cells."""
    folder = resources.files("app.sim") / "cells_data"
    return tuple(
        sorted(
            entry.name.removesuffix(".json")
            for entry in folder.iterdir()
            if entry.name.endswith(".json")
        )
    )


@cache
def load_cell(name: str = "pick-and-place") -> Cell:
    """Return a shipped cell.

    Raises:
        NotFound: No cell of that name is shipped.
    """
    if name not in cell_names():
        raise NotFound("cell", name, cell_names())
    text = (resources.files("app.sim") / "cells_data" / f"{name}.json").read_text("utf-8")
    return Cell.model_validate(json.loads(text))
