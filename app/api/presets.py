"""The presets a training can start from, with the limits of every field."""

from fastapi import APIRouter

from app.api.schemas.presets import PresetList, PresetPublic
from app.api.services import ServicesDep
from app.policies.presets import PRESETS
from app.sim.cells import lacks_for_pick

router = APIRouter(prefix="/v1/presets", tags=["jobs"])


@router.get("", summary="List the presets")
def list_all(services: ServicesDep) -> PresetList:
    """Return every preset with its fields, their values, limits and units."""
    cells = [cell.name for cell in services.cells.all() if lacks_for_pick(cell) is None]
    return PresetList(items=[PresetPublic.from_name(name, cells) for name in PRESETS])
