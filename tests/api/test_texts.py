"""Text and integers that no part of the service takes are found wherever they are."""

import json
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.api.texts import MAX_DEPTH, fault_in_address, fault_in_json
from app.store.cursors import decode_cursor, encode_cursor
from tests.api.answers import problem_of

FAULTS: list[tuple[bytes, str, str]] = [
    (b"\xff", "body", "UTF-8"),
    (b'{"a": "\xed\xa0\x80"}', "body", "UTF-8"),
    ('{"a": 1}'.encode("utf-16-le"), "body", "text in UTF-8 without NUL"),
    (b"[" * 65, "body", "nested at most 64"),
    (b'{"a":' * 100_000, "body", "nested at most 64"),
    (b'["]]]]' + b'", [' * 3 + b"[" * 70, "body", "nested at most 64"),
    (b'{"a": {"b": ["x", "\\uD800"]}}', "a.b[1]", "surrogate"),
    (b'{"a": "\\udfff\\ud800"}', "a", "surrogate"),
    (b'{"a": "x\\u0000"}', "a", "NUL"),
    (b'{"\\ud800": 1}', "\\ud800", "name"),
    (b'{"a": [{"x\\u0000": 1}]}', "a[0].x\0", "name"),
    (b'{"a": 9223372036854775808}', "a", "9223372036854775807"),
    (b'{"a": [-9223372036854775809]}', "a[0]", "-9223372036854775808"),
    (b"1" + b"0" * 400, "body", "9223372036854775807"),
    (b'{"a": ' + b"9" * 5000 + b"}", "body", "integers of at most 4300 digits"),
]
SOUND: list[Any] = [
    {
        "a": "\U0001f600 \u00e4 \uffff \u202e",
        "b": [2**63 - 1, -(2**63), 1e308, 0.1234567890123456789012],
    },
    {"text": "[[[[[" * 1000, "more": '"' * 1000, "last": "\\" * 1001},
    [[]] * 5000,
    json.loads("[" * MAX_DEPTH + "]" * MAX_DEPTH),
    "d800",
]


@pytest.mark.parametrize(("body", "field", "rule"), FAULTS)
def test_faults_are_named(body: bytes, field: str, rule: str) -> None:
    found = fault_in_json(body)
    assert found is not None
    assert found["field"] == field
    assert rule in str(found["rule"])


@pytest.mark.parametrize("ascii_only", [True, False])
@pytest.mark.parametrize("value", SOUND)
def test_sound_values_pass(value: Any, ascii_only: bool) -> None:
    assert fault_in_json(json.dumps(value, ensure_ascii=ascii_only).encode()) is None


@pytest.mark.parametrize("body", [b"", b"{", b'"' + b'\\"' * 300_000, b'{"a": \\u0000'])
def test_what_is_no_json_is_left_to_the_parser(body: bytes) -> None:
    assert fault_in_json(body) is None


@pytest.mark.parametrize(
    ("path", "query", "field"),
    [
        ("/v1/cells/a\0", b"", "path"),
        ("/\udcff", b"", "path"),
        ("/v1/recordings", b"x=1&file_name=a%00.bvh", "file_name"),
        ("/v1/jobs", b"cursor=\0", "cursor"),
        ("/v1/jobs", b"%00=1", "\\x00"),
    ],
)
def test_addresses_hold_no_nul(path: str, query: bytes, field: str) -> None:
    found = fault_in_address(path, query)
    assert found is not None and found["field"] == field


@pytest.mark.parametrize("query", [b"", b"a=%ff&b=%C3%A4", b"a=%2500"])
def test_other_addresses_pass(query: bytes) -> None:
    assert fault_in_address("/v1/\u00e4\U0001f600", query) is None


HUGE = [2**63, 10**20 - 1, 10**40]


@pytest.mark.parametrize("number", HUGE)
def test_integers_beyond_64_bits_are_refused_with_the_bound(
    client: TestClient, number: int
) -> None:
    job = client.post("/v1/jobs", json={"kind": "evaluate", "protocol": "pick-single"}).json()
    url = f"/v1/jobs/{job['id']}"
    client.post(f"{url}/cancel")
    answers = {
        "after_step": client.get(f"{url}/metrics", params={"after_step": number}),
        "last-event-id": client.get(f"{url}/events", headers={"Last-Event-ID": str(number)}),
    }
    for field, answer in answers.items():
        assert answer.status_code == 422
        assert answer.json()["field"] == field
        assert "9223372036854775807" in answer.json()["rule"]
    for path in ("/v1/jobs", "/v1/checkpoints"):
        beyond = (number, 2**31, -number, -1)
        for cursor in map(encode_cursor, beyond):
            assert problem_of(client.get(path, params={"cursor": cursor}))["field"] == "cursor"
    assert client.get(f"{url}/metrics", params={"after_step": 2**63 - 1}).json()["items"] == []


def test_the_greatest_cursor_is_one() -> None:
    assert decode_cursor(encode_cursor(2**31 - 1)) == 2**31 - 1
    assert decode_cursor(encode_cursor(2**63 - 1), 2**63 - 1) == 2**63 - 1


@pytest.mark.parametrize(
    "path",
    ["/v1/cells/a%00", "/v1/checkpoints/%00", "/v1/jobs/a%00b", "/v1/recordings?file_name=%00"],
)
def test_nul_in_an_address_is_refused_before_any_database_sees_it(
    client: TestClient, path: str
) -> None:
    answer = client.get(path)
    assert answer.status_code == 422
    assert "NUL" in answer.json()["rule"]
