"""Refusal of a WebSocket with a reason."""

from starlette.websockets import WebSocket

TRY_AGAIN = 1013
"""Close code: try again later."""


async def refuse(client: WebSocket, reason: str) -> None:
    """Open and close a socket; a browser sees the reason of no other refusal.

    Args:
        client: Socket that is not open yet.
        reason: One sentence of at most 123 bytes.
    """
    offered: list[str] = client.scope.get("subprotocols", [])
    await client.accept(offered[0] if offered else None)
    await client.close(TRY_AGAIN, reason)
