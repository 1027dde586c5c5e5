"""Liveness and readiness, for monitors.

Both routes are open; without the token they tell nothing else.
"""

from typing import Any

from fastapi import APIRouter, Request

from app.api.services import Services, ServicesDep
from app.errors import NotReady

router = APIRouter(tags=["health"])
HEALTH, READY = PATHS = ("/healthz", "/readyz")
"""Paths answered without the token."""


@router.get(HEALTH, summary="200 when the service can decide")
async def health(request: Request, services: ServicesDep) -> dict[str, Any]:
    """Answer 200 when the service can decide, a 503 problem otherwise.

    With the token, it names the live worlds, and the problem contains the reason.
    """
    if _is_trusted(request, services):
        return {"status": "ok", "worlds": list(services.worlds)}
    return {"status": "ok"}


@router.get(READY, summary="503 while the kernels are compiled")
async def ready(request: Request, services: ServicesDep) -> dict[str, Any]:
    """Answer 200 once the kernels are compiled, a 503 problem until then.

    With the token, the problem contains the present activity. ``degraded`` names damaged
    checkpoints (all others can be used), and says why the queue of jobs waits.
    """
    if not _is_trusted(request, services):
        return {"status": "ready"}
    found: dict[str, Any] = {}
    if damaged := services.checkpoints.damaged:
        found["damaged"] = damaged
    if waiting := services.supervisor.waiting:
        found["queue"] = f"waiting: {waiting}"
    return {"status": "degraded" if found else "ready", **found}


def _is_trusted(request: Request, services: Services) -> bool:
    """Return whether the caller may see details.

    Raises:
        NotReady: The service cannot decide; a trusted caller gets the reason.
    """
    trusted = bool(request.state.trusted)
    if not trusted and not services.readiness.ready:
        raise NotReady("the service is up and not ready")
    services.readiness.require()
    return trusted
