"""Compression of answers for clients that accept it, by ``Accept-Encoding`` (RFC 9110)."""

from starlette.datastructures import Headers
from starlette.middleware.gzip import GZipMiddleware
from starlette.types import Receive, Scope, Send

ACCEPT = "accept-encoding"


def accepts_gzip(accepted: str) -> bool:
    """Return whether a client takes gzip.

    Args:
        accepted: Its ``Accept-Encoding``, such as ``gzip;q=0.5, *;q=0``: quality 0 refuses a
            coding, and ``*`` stands for those that are not listed (RFC 9110, section 12.5.3).
    """
    qualities = {}
    for one in "".join(accepted.lower().split()).split(","):
        coding, weighted, quality = one.partition(";q=")
        qualities[coding] = quality if weighted else "1"
    return qualities.get("gzip", qualities.get("*", "0")).strip("0.") != ""


class Compression(GZipMiddleware):
    """Compression by gzip; Starlette's middleware ignores the quality of the coding."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on with the word if its client takes gzip, else without codings."""
        headers = [pair for pair in scope["headers"] if pair[0] != ACCEPT.encode()]
        if accepts_gzip(Headers(scope=scope).get(ACCEPT, "")):
            headers.append((ACCEPT.encode(), b"gzip"))
        await super().__call__({**scope, "headers": headers}, receive, send)
