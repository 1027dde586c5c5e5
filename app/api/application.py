"""The HTTP application: routers, error handlers, access control and the page."""

from collections.abc import Callable
from contextlib import AbstractAsyncContextManager
from pathlib import Path

from fastapi import Depends, FastAPI, Request
from fastapi.routing import APIRoute
from opentelemetry.trace import TracerProvider
from starlette.responses import FileResponse, Response
from starlette.staticfiles import StaticFiles

from app.api import description, problems
from app.api.bodies import BodyMiddleware
from app.api.compression import Compression
from app.api.direct_routes import DirectRouteMiddleware
from app.api.metrics import Metrics
from app.api.responses import ResponseMiddleware
from app.api.routes import (
    aliases,
    attempts,
    cells,
    checkpoints,
    health,
    job_actions,
    jobs,
    presets,
    protocols,
    recordings,
    reference,
    results,
    session,
    trackers,
    viewer,
    worlds,
)
from app.api.routes.decisions import motion, plan, risk_map, sorting, task_selection
from app.api.security import SESSION_PATH, AccessMiddleware
from app.api.validation import check_query

ICON_PATH = "/favicon.ico"
"""Default path of a page's icon; open, as the sign-in page is."""
Lifespan = Callable[[FastAPI], AbstractAsyncContextManager[None]]

DESCRIPTION = (
    "Decisions of a robot arm that shares its work cell with people: its next task and its "
    "motion. SI units and radians; positions in the robot's base frame. Every error is a "
    "problem document (RFC 9457)."
)


def build_app(
    *,
    lifespan: Lifespan,
    static: Path,
    token: str | None,
    version: str,
    counts: Metrics,
    traces: TracerProvider | None,
) -> FastAPI:
    """Return the application; its lifespan sets ``app.state.services``.

    Args:
        static: Folder of the page.
        token: The token required of every request; None on loopback.
        traces: Receives a span of each request; None: none is made.
    """
    app = FastAPI(
        telemetry={
            "tracer_provider": traces,
            "tracing": traces is not None,
            "metrics": False,
            "logs": False,
        },
        title="Tandem",
        version=version,
        description=DESCRIPTION,
        lifespan=lifespan,
        redirect_slashes=False,
        docs_url=None,
        redoc_url=None,
        responses={422: {}},
        generate_unique_id_function=lambda route: route.name,  # of its function, unique
    )
    app.state.token = token
    app.state.metrics = counts
    problems.install(app)
    for part in (
        task_selection,
        sorting,
        plan,
        risk_map,
        motion,
        trackers,
        worlds,
        jobs,
        job_actions,
        attempts,
        results,
        checkpoints,
        aliases,
        presets,
        protocols,
        cells,
        recordings,
    ):
        app.include_router(part.router, dependencies=[Depends(check_query)])
    for part in (health, session, viewer, reference):
        app.include_router(part.router)
    description.install(app)
    add_page(app, static)
    app.add_middleware(
        BodyMiddleware, files=recordings.FILES | checkpoints.FILES | attempts.FILES
    )
    if traces is None:
        app.add_middleware(DirectRouteMiddleware, routes=decision_routes())
    open_paths = (SESSION_PATH, ICON_PATH, *health.PATHS)
    app.add_middleware(AccessMiddleware, token=token, open_paths=open_paths)
    app.add_middleware(ResponseMiddleware, metrics=counts)
    return app


def decision_routes() -> list[APIRoute]:
    """Return the routes of decisions, without the socket."""
    return [
        one
        for part in (task_selection, motion, plan, risk_map, sorting)
        for one in part.router.routes
        if isinstance(one, APIRoute)
    ]


def add_page(app: FastAPI, static: Path) -> None:
    """Serve the page at ``/`` and its files under ``/static``.

    Browsers cache both and revalidate them at each request (``ETag``, ``no-cache``).
    """
    files = StaticFiles(directory=static)

    @app.get("/", include_in_schema=False)
    async def index(request: Request) -> Response:
        return await files.get_response("index.html", request.scope)

    @app.get(ICON_PATH, include_in_schema=False)
    async def icon() -> FileResponse:
        return FileResponse(static / "favicon.ico", media_type="image/x-icon")

    app.mount("/static", Compression(files), name="static")
