"""Limits of WebSocket messages, and refusal of a socket with a reason."""

from starlette.websockets import WebSocket

MAX_MESSAGE = 64 * 1024
"""Longest message of a client: characters of a text, bytes of another frame."""
MAX_MESSAGE_BYTES = 4 * MAX_MESSAGE
"""Largest message that the server receives: a character has at most four bytes in UTF-8."""
TRY_AGAIN, POLICY, TOO_LARGE = 1013, 1008, 1009
"""Close codes: try again later; the request breaks a rule; the message is too large."""

MAX_REASON = 123
"""Longest reason [bytes]."""


async def refuse(client: WebSocket, reason: str, code: int = TRY_AGAIN) -> None:
    """Open and close a socket; a browser sees the reason of no other refusal.

    The reason is one sentence, of which 123 bytes are sent.
    """
    offered: list[str] = client.scope.get("subprotocols", [])
    await client.accept(offered[0] if offered else None)
    await client.close(code, reason.encode()[:MAX_REASON].decode(errors="ignore"))
