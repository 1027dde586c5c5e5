"""The work cells the service knows, shipped ones and the user's own, as data."""

from typing import Any

from fastapi import APIRouter, Request, Response
from starlette.concurrency import run_in_threadpool

from app.api.schemas.cells import CellList, CellPublic, cell_schema
from app.api.services import Services, ServicesDep
from app.errors import Conflict
from app.sim.cell_validation.reader import read_cell

router = APIRouter(prefix="/v1/cells", tags=["cells"])

BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {"application/json": {"schema": cell_schema()}},
    }
}
"""The body is read as bytes, so that its faults can be told with their place in the text."""


@router.get("", summary="List the work cells")
def list_all(services: ServicesDep) -> CellList:
    """Return every cell with its stations, people, limits and case studies."""
    return CellList(items=[CellPublic.from_domain(cell) for cell in services.cells.all()])


@router.get("/{name}", summary="One work cell")
def get_one(name: str, services: ServicesDep) -> CellPublic:
    """Return one cell."""
    return CellPublic.from_domain(services.cells.get(name))


@router.post("", status_code=201, summary="Add a work cell of your own", openapi_extra=BODY)
async def create(request: Request, services: ServicesDep, response: Response) -> CellPublic:
    """Check a cell and keep it; the same one again answers 200, faults are all in `errors`."""
    content = await request.body()
    cell = await run_in_threadpool(read_cell, content)
    if not await run_in_threadpool(services.cells.add, cell):
        response.status_code = 200
    response.headers["Location"] = f"/v1/cells/{cell.name}"
    return CellPublic.from_domain(cell)


@router.delete("/{name}", status_code=204, summary="Remove a work cell of your own")
def remove(name: str, services: ServicesDep) -> None:
    """Forget a cell; policies that were trained in it carry a copy and stay."""
    _require_unused(services, name)
    services.cells.remove(name)


def _require_unused(services: Services, name: str) -> None:
    for world_id, world in services.worlds.items():
        if world.cell.name == name:
            raise Conflict(
                f"cell {name!r} is shown by the live world {world_id!r}: let it show another "
                "cell first"
            )
