"""Whether the service lives, and whether it can decide.

Both routes are open, for monitors without the token; these learn nothing but that.
"""

from typing import Any

from fastapi import APIRouter, Request

from app.api.services import Services, ServicesDep
from app.errors import NotReady

router = APIRouter(tags=["health"])
HEALTH, READY = PATHS = ("/healthz", "/readyz")
"""Paths that are answered without the token."""


@router.get(HEALTH, summary="200 when the service can decide")
async def health(request: Request, services: ServicesDep) -> dict[str, Any]:
    """Answer 200 when the service can decide, a 503 problem otherwise.

    With the token, where there is one, it names the live worlds, and the problem says why.
    """
    if _told_all(request, services):
        return {"status": "ok", "worlds": list(services.worlds)}
    return {"status": "ok"}


@router.get(READY, summary="503 while the kernels warm up")
async def ready(request: Request, services: ServicesDep) -> dict[str, Any]:
    """Answer 200 once everything is warm, a 503 problem until then.

    With the token, where there is one, the problem says what is going on, and ``degraded``
    names stored checkpoints that are damaged; all others decide.
    """
    damaged = services.checkpoints.damaged if _told_all(request, services) else ()
    return {"status": "degraded", "damaged": damaged} if damaged else {"status": "ready"}


def _told_all(request: Request, services: Services) -> bool:
    """Return whether the caller may learn details.

    Raises:
        NotReady: The service cannot decide; says why to those who may.
    """
    trusted = bool(request.state.trusted)
    if not trusted and not services.readiness.ready:
        raise NotReady("the service is up and not ready")
    services.readiness.require()
    return trusted
