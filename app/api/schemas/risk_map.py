"""``POST /v1/risk-map``: a decision and the positions of a person in, choices and risks out."""

from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from app.api.schemas.examples import RISK_MAP, shows
from app.api.schemas.numbers import Answer, Body, Data, Finite
from app.api.schemas.people import PersonUse
from app.api.schemas.task_selection import OutOfRangeInput, Stamp, TaskSelectionRequest
from app.errors import InvalidInput
from app.sim.perception.multi_person_tracker import MAX_SKELETONS
from app.sim.pick.person_grid import NOT_REACHED, PersonGrid
from app.sim.pick.task_policy import ChoiceTerms, Decision, RiskMap

CONTACT = "contact"
Reason = Literal["contact", "unreachable"]
Coordinate = Annotated[float, Field(ge=-4.9, le=4.9, allow_inf_nan=False)]
Bounds = Annotated[tuple[Coordinate, Coordinate], Field(strict=False)]
Count = Annotated[int, Field(ge=1, le=50)]


class GridFields(Body):
    """Positions of one person, or of one hand of that person, in `frame`."""

    what: Literal["person", "hand"] = Field(
        "person",
        description="what is moved: the whole `person`, the pelvis to each position, or one "
        "`hand`, the pelvis stays",
    )
    person: Annotated[int, Field(ge=0, lt=MAX_SKELETONS)] = Field(
        0, description="index of the person in `people`"
    )
    hand: Literal["right", "left"] = Field("right", description="the moved hand")
    x: Bounds = Field(description="least and greatest x [m]")
    y: Bounds = Field(description="least and greatest y [m]")
    z: Annotated[float, Field(ge=-1.0, le=2.0)] = Field(
        0.15, description="height of the palm over the table [m], for `hand`"
    )
    nx: Count = Field(25, description="positions along x")
    ny: Count = Field(25, description="positions along y")

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Check the order of the bounds.

        Raises:
            InvalidInput: An upper bound is below the lower one, or equal for several
                positions.
        """
        for name, (low, high), n in (("x", self.x, self.nx), ("y", self.y, self.ny)):
            if low > high:
                rule = "must be the least and the greatest value, in this order"
                raise InvalidInput(f"grid.{name}", [low, high], rule)
            if low == high and n > 1:
                rule = f"must be two values for n{name} = {n} positions"
                raise InvalidInput(f"grid.{name}", [low, high], rule)
        return self

    def to_domain(self) -> PersonGrid:
        """Return the positions as arrays."""
        return PersonGrid(
            x=np.linspace(*self.x, self.nx),
            y=np.linspace(*self.y, self.ny),
            hand=None if self.what == "person" else ("r" if self.hand == "right" else "l"),
            z=self.z,
        )


class RiskMapRequest(TaskSelectionRequest):
    """A task selection, and the positions that a person may have instead."""

    model_config = shows(RISK_MAP)

    grid: GridFields

    @property
    def terms(self) -> ChoiceTerms:
        """What the choices depend on beside the state."""
        return ChoiceTerms(
            previous=self.previous,
            progress=self.progress,
            time_left_s=self.time_left_s,
            objective=self.objective,
        )


class RiskMapAnswer(Answer):
    """Choices and risks at every position; rows along y, from its least value on."""

    x: list[float] = Field(description="positions along x [m]")
    y: list[float] = Field(description="positions along y [m]")
    chosen: list[list[str | None]] = Field(description="id of the chosen candidate")
    value: list[list[float | None]] = Field(description="its value Q(s, pi(s))")
    success: list[list[float | None]] | None = Field(
        description="its probability of success; null where the checkpoint predicts none"
    )
    contact: list[list[float | None]] | None = Field(description="its probability of a contact")
    clearance_m: list[list[float | None]] = Field(
        description="distance of the robot to people there, at most 1.5 m [m]"
    )
    reason: list[list[Reason | None]] = Field(
        description="why a position has no values: `contact` of robot and person there, or "
        "`unreachable` by the hand"
    )
    posture_outside: list[list[bool | None]] = Field(
        description="whether the person's posture there is outside the training range"
    )
    people: list[PersonUse] = Field(description="use of each person at the given position")
    state_outside: list[OutOfRangeInput] = Field(
        description="robot, people at the given positions and time left outside the training "
        "range or the joint limits"
    )
    checkpoint: str = Field(description="SHA-256 of the checkpoint")
    elapsed_ms: Finite = Field(description="time of the map [ms]")
    stamp: Stamp = None

    @classmethod
    def from_domain(
        cls,
        found: RiskMap,
        reached: NDArray[np.bool_],
        request: RiskMapRequest,
        people: list[Data],
        decision: Decision,
    ) -> Self:
        """Return the answer of a map.

        Args:
            reached: Whether the hand reaches each position, shape (m,).
            decision: Decision at the given positions.
        """
        grid = request.grid.to_domain()
        touched = found.clearance_m <= 0.0
        none = touched | ~reached

        def rows(values: NDArray[Any], empty: NDArray[np.bool_] = none) -> list[list[Any]]:
            table = values.astype(object)
            table[empty] = None
            return table.reshape(grid.shape).tolist()

        names = np.array([one.id for one in request.candidates], dtype=object)
        reason = np.where(reached, CONTACT, NOT_REACHED)
        return cls(
            x=grid.x.tolist(),
            y=grid.y.tolist(),
            chosen=rows(names[found.chosen]),
            value=rows(found.value),
            success=None if found.success is None else rows(found.success),
            contact=None if found.contact is None else rows(found.contact),
            clearance_m=rows(found.clearance_m),
            reason=rows(reason, ~none),
            posture_outside=rows(found.outside),
            people=[PersonUse(**one) for one in people],
            state_outside=[OutOfRangeInput.model_validate(one) for one in decision.outside],
            checkpoint=decision.checkpoint,
            elapsed_ms=found.elapsed_ms,
            stamp=request.stamp,
        )
