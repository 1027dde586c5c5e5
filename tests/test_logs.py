import json
import logging
import sys

import pytest

from app.logs import REQUEST_ID, LineFormatter


def record(**extra: object) -> logging.LogRecord:
    made = logging.LogRecord("app.x", logging.WARNING, "x.py", 1, "%d jobs", (3,), None)
    made.created, made.msecs = 1.25, 250.0
    vars(made).update(extra)
    return made


def test_json_line_has_time_level_message_and_fields() -> None:
    line = LineFormatter("json", job_id="j").format(record(attempt=2))
    assert json.loads(line) == {
        "time": "1970-01-01T00:00:01.250Z",
        "level": "WARNING",
        "logger": "app.x",
        "message": "3 jobs",
        "job_id": "j",
        "attempt": 2,
    }


def test_text_line_has_the_same() -> None:
    line = LineFormatter("text", job_id="j").format(record(attempt=2))
    assert line == "1970-01-01T00:00:01.250Z WARNING job_id=j attempt=2 app.x: 3 jobs"


@pytest.mark.parametrize("style", ["json", "text"])
def test_line_of_a_request_has_its_id(style: str) -> None:
    token = REQUEST_ID.set("r-1")
    try:
        line = LineFormatter(style).format(record())  # type: ignore[arg-type]
    finally:
        REQUEST_ID.reset(token)
    assert "r-1" in line and "request_id" in line
    assert "r-1" not in LineFormatter(style).format(record())  # type: ignore[arg-type]


def test_json_line_of_an_error_is_one_line_with_the_trace() -> None:
    made = record()
    try:
        raise ValueError("two\nlines")
    except ValueError:
        made.exc_info = sys.exc_info()
    line = LineFormatter("json").format(made)
    assert "\n" not in line
    assert "ValueError: two\nlines" in json.loads(line)["exception"]


def test_json_line_keeps_any_text() -> None:
    made = record()
    made.msg, made.args = 'quote " and line\n and ü and \udc80', None
    line = LineFormatter("json").format(made)
    assert json.loads(line)["message"] == made.msg
    line.encode("utf-8", "strict")


def test_text_of_a_request_makes_no_line_of_its_own() -> None:
    made = record(path="/a\nb")
    made.msg = "GET %s"
    made.args = ("/v1/jobs/x\n2026-01-01T00:00:00.000Z ERROR app: forged\r\x1b[2K\u2028end",)
    try:
        raise ValueError("bad\n2026-01-01T00:00:00.000Z ERROR app: forged")
    except ValueError:
        made.exc_info = sys.exc_info()
    first, *others = LineFormatter("text").format(made).split("\n")
    assert first.endswith("GET /v1/jobs/x") and r"path=/a\nb" in first
    assert others[0].endswith(r"ERROR app: forged\r\x1b[2K\u2028end")
    assert others[1].strip() == "Traceback (most recent call last):"
    assert all(line.startswith("    ") for line in others)
