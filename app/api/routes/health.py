"""Liveness, readiness and metrics, for monitors.

Liveness and readiness need no token; without it they answer the status only.
"""

from datetime import UTC, datetime, timedelta
from typing import Literal

from fastapi import APIRouter, Request
from prometheus_client.exposition import choose_encoder
from pydantic import Field
from starlette.responses import Response

from app.api.metrics import Metrics
from app.api.schemas.numbers import Answer
from app.api.services import ServicesDep
from app.errors import NotReady

router = APIRouter(tags=["health"])
HEALTH, READY = PATHS = ("/healthz", "/readyz")
"""Paths answered without the token."""
STALLED_S = 10.0
"""Time without a tick after which a live world counts as stalled [s].

Hundreds of its periods of 20 to 50 ms, which a busy machine does not delay it by.
"""


class HealthPublic(Answer):
    """The process answers requests."""

    status: Literal["ok"] = "ok"
    worlds: list[str] | None = Field(
        default=None, description="ids of the live worlds, with the token"
    )


class ReadinessPublic(Answer):
    """The service can decide."""

    status: Literal["ready", "degraded"]
    damaged: list[str] | None = Field(
        default=None, description="names of damaged checkpoints, with the token"
    )
    queue: str | None = Field(
        default=None, description="why the queue of jobs waits, with the token"
    )
    stalled: dict[str, datetime] | None = Field(
        default=None,
        description=f"live worlds without a tick for {STALLED_S:g} s, with the time of their "
        "last one, with the token",
    )


@router.get(HEALTH, summary="200 while the process answers", response_model_exclude_none=True)
async def health(request: Request, services: ServicesDep) -> HealthPublic:
    """Answer 200 while the process answers, also before it can decide.

    With the token, it names the live worlds.
    """
    return HealthPublic(worlds=list(services.worlds) if request.state.trusted else None)


@router.get(READY, summary="200 when the service can decide", response_model_exclude_none=True)
async def ready(request: Request, services: ServicesDep) -> ReadinessPublic:
    """Answer 200 when the service can decide, a 503 problem otherwise.

    It cannot decide before checkpoints are loaded, kernels compiled and the live world has
    started, nor while the server stops. With the token, the problem contains the present
    activity. ``degraded`` names damaged checkpoints (all others can be used), gives the reason
    if the queue of jobs waits, and names stalled live worlds. Decisions and jobs do not depend
    on these: the answer stays 200.
    """
    if not request.state.trusted:
        if not services.readiness.ready:
            raise NotReady("the service is up and not ready")
        return ReadinessPublic(status="ready")
    services.readiness.require()
    damaged, waiting = services.checkpoints.damaged, services.supervisor.waiting
    now = datetime.now(UTC)
    stalled = {
        name: now - timedelta(seconds=age)
        for name, world in services.worlds.items()
        if (age := world.handle.since_snapshot_s()) > STALLED_S
    }
    return ReadinessPublic(
        status="degraded" if damaged or waiting or stalled else "ready",
        damaged=list(damaged) or None,
        queue=f"waiting: {waiting}" if waiting else None,
        stalled=stalled or None,
    )


@router.get(
    "/metrics",
    summary="Metrics for Prometheus",
    response_class=Response,
    responses={
        200: {
            "content": {"text/plain": {}, "application/openmetrics-text": {}},
            "description": "text format of Prometheus, or OpenMetrics by `Accept`",
        }
    },
)
def scrape(request: Request) -> Response:
    """Return every metric; `docs/operations.md` lists them."""
    metrics: Metrics = request.app.state.metrics
    encode, media_type = choose_encoder(request.headers.get("accept", ""))
    return Response(encode(metrics.registry), headers={"Content-Type": media_type})
