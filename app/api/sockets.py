"""Refusing a WebSocket so that its caller learns why."""

from starlette.websockets import WebSocket

TRY_AGAIN = 1013
"""Close code: try again later."""


async def refuse(client: WebSocket, reason: str) -> None:
    """Open a socket only to close it: a browser learns the reason of no other refusal.

    Args:
        client: Socket that is not open yet.
        reason: One sentence of at most 123 bytes.
    """
    offered: list[str] = client.scope.get("subprotocols", [])
    await client.accept(offered[0] if offered else None)
    await client.close(TRY_AGAIN, reason)
