"""Work cells as data, shipped ones and the user's own."""

from typing import Any

from fastapi import APIRouter, Request, Response
from starlette.concurrency import run_in_threadpool

from app.api.description import set_stored, stored_responses
from app.api.schemas.cells import CellList, CellPublic, cell_schema
from app.api.services import ServicesDep
from app.errors import Conflict
from app.sim.cell_validation.reader import read_cell
from app.sim.cells.cell import load_cell

router = APIRouter(prefix="/v1/cells", tags=["cells"])

BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {
            "application/json": {
                "schema": cell_schema(),
                "example": load_cell("pick-and-place").definition()
                | {"name": "my-cell", "title": "My cell"},
            }
        },
    }
}
"""The body is read as bytes, so that its faults carry their place in the text."""


@router.get("", summary="List the work cells")
def list_cells(services: ServicesDep) -> CellList:
    """Return every cell with its stations, people, limits and case studies."""
    return CellList(items=[CellPublic.from_domain(cell) for cell in services.cells.all()])


@router.get("/{name}", summary="One work cell")
def get_cell(name: str, services: ServicesDep) -> CellPublic:
    """Return one cell."""
    return CellPublic.from_domain(services.cells.get(name))


@router.post(
    "",
    status_code=201,
    summary="Add a work cell of your own",
    openapi_extra=BODY,
    responses={
        **stored_responses(CellPublic, "The same cell"),
        409: {"description": "Another cell has the name, or too many are stored"},
    },
)
async def create_cell(
    request: Request, services: ServicesDep, response: Response
) -> CellPublic:
    """Check a cell and store it; the same cell again answers 200; `errors` has all faults."""
    content = await request.body()
    cell = await run_in_threadpool(read_cell, content)
    new = await run_in_threadpool(services.cells.add, cell)
    set_stored(response, f"{router.prefix}/{cell.name}", new=new)
    return CellPublic.from_domain(cell)


@router.delete(
    "/{name}",
    status_code=204,
    summary="Remove a work cell of your own",
    responses={
        409: {"description": "It is shipped, a job trains in it, or a live world shows it"},
        507: {},
    },
)
def delete_cell(name: str, services: ServicesDep) -> None:
    """Remove a cell; policies trained in it have their own copy."""
    with services.replacing:
        for world_id, world in services.worlds.items():
            if world.cell.name == name:
                raise Conflict(
                    f"cell {name!r} is shown by the live world {world_id!r}: show another cell "
                    "there first"
                )
        services.cells.remove(name)
