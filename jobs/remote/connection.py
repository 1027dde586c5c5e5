"""Requests of a worker to the service; problems become the errors of the store."""

import time
from collections.abc import Mapping
from typing import Any
from urllib.parse import quote

import httpx

from app.errors import ServiceError
from app.storage_errors import ServerUnreachable, StaleAttempt, StorageFull
from app.store.records import Claim

TIMEOUT_S = 120.0
"""Time limit of an answer; the largest file is committed within seconds [s]."""
CONNECT_S = 10.0
"""Time limit of a connection [s]."""
BUSY_S = 60.0
"""Time for which a request is repeated while the server reads too many files [s]."""
PAUSE_S = 1.0
"""Time until a request is repeated [s]."""
PREFIX = "urn:tandem:problem:"
FOR_NOW = (408, 425, 429, 502, 503, 504)
"""Statuses of a server, or a proxy before it, that did not take a request for now.

Tandem states its errors as problems and redirects no worker: others below 500 are those of a
proxy without a server.
"""


class ServiceConnection:
    """A connection of one attempt to the service; safe to use from any thread.

    Args:
        address: Address of the service, with the path of a reverse proxy.
        token: Its token; None where it has none.
    """

    def __init__(self, address: str, token: str | None, claim: Claim) -> None:
        headers = {} if token is None else {"Authorization": f"Bearer {token}"}
        timeout = httpx.Timeout(TIMEOUT_S, connect=CONNECT_S)
        self._address, self._claim = address, claim
        self._http = httpx.Client(base_url=address, headers=headers, timeout=timeout)
        self.attempt = f"/v1/jobs/{quote(claim.job_id, safe='')}/attempts/{claim.attempt}"
        """Path of the attempt."""

    def close(self) -> None:
        """Close the connection."""
        self._http.close()

    def send(
        self,
        method: str,
        path: str,
        *,
        query: Mapping[str, Any] | None = None,
        body: Mapping[str, Any] | None = None,
        content: bytes | None = None,
    ) -> httpx.Response:
        """Return the answer to a request.

        Raises:
            StaleAttempt: The attempt no longer holds the job.
            StorageFull: The disk of the server is full.
            ServerUnreachable: The server does not answer for now.
            ServiceError: It refuses the request.
        """
        until = time.monotonic() + BUSY_S
        while True:
            try:
                answer = self._http.request(
                    method, path, params=query, json=body, content=content
                )
            except httpx.TransportError as error:
                raise ServerUnreachable(self._address, repr(error)) from error
            problem = self._problem(answer)
            busy = problem.get("type") == f"{PREFIX}not-ready" and time.monotonic() < until
            if not busy:
                break
            time.sleep(PAUSE_S)
        if not answer.is_success:
            self._raise(answer, problem)
        return answer

    def find(self, path: str, query: Mapping[str, Any] | None = None) -> bytes | None:
        """Return the content at a path; None where there is none.

        Raises:
            ServiceError: As for :meth:`send`.
        """
        try:
            return self.send("GET", path, query=query).content
        except MissingAtServer:
            return None

    def _problem(self, answer: httpx.Response) -> dict[str, Any]:
        """Return the problem of an answer; empty where it has none."""
        if answer.is_success:
            return {}
        try:
            found = answer.json()
        except ValueError:  # of a proxy in between
            return {}
        return found if isinstance(found, dict) else {}

    def _raise(self, answer: httpx.Response, problem: Mapping[str, Any]) -> None:
        kind = str(problem.get("type", "")).removeprefix(PREFIX)
        detail = str(problem.get("detail", answer.reason_phrase))
        if kind == "stale-attempt":
            raise StaleAttempt(self._claim.job_id, self._claim.attempt)
        if kind == "storage-full":
            raise StorageFull(str(problem.get("database", self._address)))
        if kind == "not-found":
            raise MissingAtServer(detail)
        of_proxy = not kind and answer.status_code < 500 and answer.status_code != 413
        if answer.status_code in FOR_NOW or of_proxy:
            raise ServerUnreachable(self._address, f"{answer.status_code} {detail}")
        if answer.status_code >= 500:
            answer.raise_for_status()  # the attempt ends as a crash, and is repeated
        raise ServiceError(detail)


class MissingAtServer(ServiceError):
    """The service has no object with that name or id."""
