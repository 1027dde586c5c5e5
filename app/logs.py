"""Log lines of server and workers: readable text or one JSON object per line.

Lines written while a request is answered carry its id. Fields of ``extra=`` and fixed fields,
such as the job of a worker, are members of the JSON object and ``name=value`` in text.
"""

import json
import logging
import sys
import time
from contextvars import ContextVar
from typing import Literal

Style = Literal["text", "json"]
REQUEST_ID: ContextVar[str | None] = ContextVar("request_id", default=None)
"""Id of the request that is being answered; None outside one."""
_STANDARD = {*vars(logging.makeLogRecord({})), "message", "asctime", "taskName"}


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
            shown = logging.makeLogRecord(vars(record) | {"name": text + record.name})
            return super().format(shown)
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


def set_up(style: Style, **fields: object) -> None:
    """Write the log of this process to standard error; replaces an earlier set-up.

    Args:
        style: Form of the lines.
        **fields: Fields of every line.
    """
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(LineFormatter(style, **fields))
    logging.basicConfig(level=logging.INFO, handlers=[handler], force=True)
    for chatty in ("alembic", "websockets", "uvicorn"):
        logging.getLogger(chatty).setLevel(logging.WARNING)
