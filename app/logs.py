"""Log lines of server and workers: readable text or one JSON object per line.

Lines written while a request is answered carry its id. Fields of ``extra=`` and fixed fields,
such as the job of a worker, are members of the JSON object and ``name=value`` in text. Further
lines of a text are indented and its control characters escaped, so that text of a request can
imitate no other line.
"""

import json
import logging
import re
import sys
import time
from contextvars import ContextVar
from typing import Literal

Style = Literal["text", "json"]
REQUEST_ID: ContextVar[str | None] = ContextVar("request_id", default=None)
"""Id of the request that is being answered; None outside one."""
_STANDARD = {*vars(logging.makeLogRecord({})), "message", "asctime", "taskName"}
_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029]")
_INDENT = "    "


class LineFormatter(logging.Formatter):
    """Writes a record with its time in UTC and its fields."""

    converter = staticmethod(time.gmtime)
    default_msec_format = "%s.%03dZ"
    default_time_format = "%Y-%m-%dT%H:%M:%S"

    def __init__(self, style: Style, **fields: object) -> None:
        super().__init__("%(asctime)s %(levelname)s %(name)s: %(message)s")
        self._json = style == "json"
        self._fixed = fields

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        fields = self._fixed | {k: v for k, v in vars(record).items() if k not in _STANDARD}
        if (request_id := REQUEST_ID.get()) is not None:
            fields["request_id"] = request_id
        if not self._json:
            text = "".join(f"{name}={value} " for name, value in fields.items())
            changes: dict[str, object] = {
                "name": _printable(text).replace("\n", "\\n") + record.name,
                "msg": _printable(record.getMessage()).replace("\n", f"\n{_INDENT}"),
                "args": None,
            }
            if record.exc_info:
                trace = _printable(self.formatException(record.exc_info))
                changes["exc_text"] = _INDENT + trace.replace("\n", f"\n{_INDENT}")
            return super().format(logging.makeLogRecord(vars(record) | changes))
        line = {
            "time": self.formatTime(record),
            "level": record.levelname,
            "logger": record.name,
            "message": record.getMessage(),
            **fields,
        }
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(line, default=str)


def _printable(text: str) -> str:
    """Return a text with its control characters escaped, line feeds and tabs excepted."""
    return _CONTROL.sub(lambda found: ascii(found[0])[1:-1], text)


def set_up(style: Style, **fields: object) -> None:
    """Write the log of this process to standard error; replaces an earlier set-up.

    Args:
        style: Form of the lines.
        **fields: Fields of every line.
    """
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(LineFormatter(style, **fields))
    logging.basicConfig(level=logging.INFO, handlers=[handler], force=True)
    for chatty in ("alembic", "websockets", "uvicorn", "httpx"):
        logging.getLogger(chatty).setLevel(logging.WARNING)
