"""SHA-256 of stored data: canonical JSON followed by bytes."""

import hashlib
import json
from typing import Any


def canonical(value: Any) -> str:
    """Return JSON data in canonical form: sorted keys, no spaces.

    Raises:
        ValueError: A number is not finite.
    """
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def digest(value: Any, content: bytes = b"") -> str:
    """Return the SHA-256 of JSON data followed by bytes, 64 hexadecimal digits.

    Raises:
        ValueError: A number is not finite.
    """
    found = hashlib.sha256(canonical(value).encode())
    found.update(content)
    return found.hexdigest()


def has_digest(expected: str | None, value: Any, content: bytes = b"") -> bool:
    """Whether JSON data and bytes have a digest."""
    try:
        return digest(value, content) == expected
    except (TypeError, ValueError):  # damaged beyond JSON
        return False
