"""Whether the service lives, and whether it can decide."""

from typing import Any

from fastapi import APIRouter

from app.api.services import ServicesDep

router = APIRouter(tags=["health"])


@router.get("/healthz", summary="200 when the service can decide")
async def health(services: ServicesDep) -> dict[str, Any]:
    """Answer 200 when the service can decide, a 503 problem that says why otherwise."""
    services.readiness.require()
    return {"status": "ok", "worlds": list(services.worlds)}


@router.get("/readyz", summary="503 while the kernels warm up")
async def ready(services: ServicesDep) -> dict[str, Any]:
    """Answer 200 once everything is warm; until then a 503 problem says what is going on."""
    services.readiness.require()
    return {"status": "ready"}
