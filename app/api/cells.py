"""The work cells the service knows, as data."""

from fastapi import APIRouter

from app.api.schemas.cells import CellList, CellPublic
from app.sim.cells import cell_names, load_cell

router = APIRouter(prefix="/v1/cells", tags=["cells"])


@router.get("", summary="List the work cells")
async def list_all() -> CellList:
    """Return every cell with its stations, limits and case studies."""
    return CellList(items=[CellPublic.from_domain(load_cell(name)) for name in cell_names()])


@router.get("/{name}", summary="One work cell")
async def get_one(name: str) -> CellPublic:
    """Return one cell."""
    return CellPublic.from_domain(load_cell(name))
