"""Refusal of a WebSocket with a reason."""

from starlette.websockets import WebSocket

TRY_AGAIN, POLICY = 1013, 1008
"""Close codes: try again later; the request breaks a rule."""

MAX_REASON = 123
"""Longest reason [bytes]."""


async def refuse(client: WebSocket, reason: str, code: int = TRY_AGAIN) -> None:
    """Open and close a socket; a browser sees the reason of no other refusal.

    Args:
        client: Socket that is not open yet.
        reason: One sentence, of which 123 bytes are sent.
        code: Close code.
    """
    offered: list[str] = client.scope.get("subprotocols", [])
    await client.accept(offered[0] if offered else None)
    await client.close(code, reason.encode()[:MAX_REASON].decode(errors="ignore"))
