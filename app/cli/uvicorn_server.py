"""The application on uvicorn: one process, one worker, a quick end.

One worker, because the live world and its viewer live in this process. Frames of the viewer are
not compressed: compression costs more time than it saves.
"""

import gc
import ipaddress
import os
import socket
from collections.abc import Awaitable, Callable
from contextlib import suppress
from types import FrameType

import uvicorn
from fastapi import FastAPI
from opentelemetry.trace import TracerProvider
from starlette.concurrency import run_in_threadpool
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.sockets import MAX_MESSAGE_BYTES
from app.cli.http_limits import LimitedHttp
from app.cli.preflight import address_of
from app.cli.socket_limits import LimitedSocket
from app.errors import InvalidInput, ServiceError
from app.settings import Settings
from app.traces import finish, provider_of_environment

GRACE_S = 3
"""Time for open requests once the server stops [s]."""


class Server(uvicorn.Server):
    """uvicorn's server; it ends open streams before it waits for them."""

    def __init__(
        self, config: uvicorn.Config, app: FastAPI, traces: TracerProvider | None = None
    ) -> None:
        super().__init__(config)
        self._app, self._traces = app, traces

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """End the streams, then stop as uvicorn does."""
        services = getattr(self._app.state, "services", None)
        is_first = not self.should_exit
        super().handle_exit(sig, frame)
        if services is not None and is_first:  # a second signal must not wait for its lock
            services.stopping.set()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Stop the jobs, whose workers may write over HTTP, then stop as uvicorn does."""
        services = getattr(self._app.state, "services", None)
        if services is not None:
            services.readiness.ready, services.readiness.reason = False, "stopping"
            await run_in_threadpool(services.supervisor.stop)
        await super().shutdown(sockets)
        if self._traces is not None:
            await run_in_threadpool(finish, self._traces)


def new_server(
    app: FastAPI,
    on_tick: Callable[[], Awaitable[None]] | None = None,
    *,
    root_path: str = "",
    traces: TracerProvider | None = None,
) -> Server:
    """Return the server that runs an application.

    Args:
        on_tick: Called once a second.
        root_path: Path under which a reverse proxy shows the service and which it removes.
        traces: Exporter of spans, which is shut down after the application.
    """
    config = uvicorn.Config(
        _with_brief_failure(app),
        http=LimitedHttp,
        ws=LimitedSocket,
        root_path=root_path,
        log_config=None,
        access_log=False,
        ws_per_message_deflate=False,
        ws_max_size=MAX_MESSAGE_BYTES,
        timeout_graceful_shutdown=GRACE_S,
        callback_notify=on_tick,
        timeout_notify=0,
        server_header=False,
        forwarded_allow_ips=trusted_proxies(os.environ.get("FORWARDED_ALLOW_IPS")),
    )
    return Server(config, app, traces)


def trusted_proxies(given: str | None) -> list[str]:
    """Return the proxies whose ``X-Forwarded-*`` headers count.

    A socket of all IPv6 addresses shows an IPv4 address as ``::ffff:A.B.C.D``: both forms of
    each address are among them.

    Args:
        given: Addresses and networks, separated by commas; None: those of this machine.
    """
    listed = "127.0.0.1,::1" if given is None else given
    hosts = [one.strip() for one in listed.split(",")]
    mapped = []
    for host in hosts:
        with suppress(ValueError):  # a name, or an IPv6 address
            network = ipaddress.IPv4Network(host)
            mapped.append(f"::ffff:{network.network_address}/{96 + network.prefixlen}")
    return [*hosts, *mapped]


def _with_brief_failure(app: FastAPI) -> ASGIApp:
    """Return the application; an expected failure of its start is one line in the log."""

    async def brief(scope: Scope, receive: Receive, send: Send) -> None:
        async def send_briefly(message: Message) -> None:
            failure = failure_of(app)
            if message["type"] == "lifespan.startup.failed" and failure is not None:
                message["message"] = failure.message
            await send(message)

        await app(scope, receive, send_briefly if scope["type"] == "lifespan" else send)

    return brief


def failure_of(app: FastAPI) -> ServiceError | None:
    """Return the expected failure of an application's start; None: there was none."""
    failure: ServiceError | None = getattr(app.state, "failure", None)
    return failure


def run(settings: Settings, sock: socket.socket, report: Callable[[str], None]) -> None:
    """Run the service until it is stopped by a signal.

    Args:
        report: Called with the address at the start and once the service is ready, or with the
            reason why it cannot decide.

    Raises:
        SystemExit: The start failed: 2 for a setting, 1 for another reason.
    """
    gc.disable()  # a sixth of the time of imports: they make many objects and drop few
    import torch

    from app.main import create_app

    gc.enable()
    report(f"Tandem starts: {address_of(sock)}")
    # More threads do not speed up networks this small; waiting for a busy core costs 0.3 s.
    torch.set_num_threads(1)
    traces = provider_of_environment()
    app = create_app(settings, traces)
    reported = False

    async def report_readiness() -> None:
        nonlocal reported
        services = getattr(app.state, "services", None)
        if services is None or reported or services.stopping.is_set():
            return
        if services.readiness.ready:
            report(f"Tandem is ready: {address_of(sock)}")
        elif services.readiness.failed:
            report(f"Tandem cannot decide: {services.readiness.reason}")
        reported = services.readiness.ready or services.readiness.failed

    server = new_server(app, report_readiness, root_path=settings.root_path, traces=traces)
    try:
        server.run(sockets=[sock])
    except SystemExit:  # the start failed, for which uvicorn has a status of its own
        raise SystemExit(2 if isinstance(failure_of(app), InvalidInput) else 1) from None
