"""Metrics for Prometheus."""

from fastapi import APIRouter, Request
from prometheus_client.exposition import choose_encoder
from starlette.responses import Response

from app.api.metrics import Metrics

router = APIRouter(tags=["health"])
PATH = "/metrics"


@router.get(
    PATH,
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
