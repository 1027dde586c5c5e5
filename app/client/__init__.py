"""Python client of a running server; needs the extra ``client``.

transport    Requests, problems and event streams over HTTP
operations/  One method per operation of the OpenAPI document; written by ``make client``
"""

from app.client.operations import Client
from app.client.transport import Refused, StreamEvent

__all__ = ["Client", "Refused", "StreamEvent"]
