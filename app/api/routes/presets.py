"""Presets of training jobs, with the limits of every field."""

from fastapi import APIRouter

from app.api.schemas.presets import PresetList, PresetPublic
from app.api.services import ServicesDep
from app.policies.configs.presets import PRESETS
from jobs.cell_catalog import lacks_for_training

router = APIRouter(prefix="/v1/presets", tags=["jobs"])


@router.get("", summary="List the presets")
def list_presets(services: ServicesDep) -> PresetList:
    """Return every preset with its fields, their values, limits and units."""
    cells, items = services.cells.all(), []
    for name, preset in PRESETS.items():
        fitting = [cell.name for cell in cells if lacks_for_training(preset, cell) is None]
        items.append(PresetPublic.from_name(name, fitting))
    return PresetList(items=items)
