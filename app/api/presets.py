"""The presets a training can start from, with the limits of every field."""

from fastapi import APIRouter

from app.api.schemas.presets import PresetList, PresetPublic
from app.policies.presets import PRESETS

router = APIRouter(prefix="/v1/presets", tags=["jobs"])


@router.get("", summary="List the presets")
async def list_all() -> PresetList:
    """Return every preset with its fields, their values, limits and units."""
    return PresetList(items=[PresetPublic.from_name(name) for name in PRESETS])
