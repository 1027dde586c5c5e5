"""Limits of the HTTP connection, asked of a server in a process of its own."""

import json
import os
import re
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from app.cli import http_limits
from tests.support import patient_http
from tests.support.small_service import LARGE, TOKEN

ROOT = Path(__file__).parents[2]
MIB = 1024 * 1024
MAX_GROWTH = 12 * MIB
LIMIT_S = 3.0
BEARER = f"Host: here\r\nAuthorization: Bearer {TOKEN}\r\n".encode()
NAME = b"GET /name?x=1 HTTP/1.1\r\n" + BEARER
POST = b"POST /length HTTP/1.1\r\n" + BEARER
UPGRADE = (
    b"Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
)
LAST = b"Connection: close\r\n\r\n"


class Small(NamedTuple):
    """The server of ``tests.support.small_service``."""

    process: subprocess.Popen[str]
    port: int

    @property
    def peak_memory(self) -> int:
        """The most memory it ever held [bytes]."""
        status = Path(f"/proc/{self.process.pid}/status").read_text(encoding="ascii")
        found = re.search(r"VmHWM:\s+(\d+) kB", status)
        assert found is not None
        return int(found[1]) * 1024

    def connect(self) -> socket.socket:
        return socket.create_connection(("127.0.0.1", self.port), timeout=120.0)

    def ask(self, request: bytes) -> bytes:
        """Send bytes over a connection of their own and return all that comes back."""
        with self.connect() as client:
            try:
                client.sendall(request)
            except ConnectionError:
                pass  # the server has heard enough
            return rest_of(client)


def rest_of(client: socket.socket) -> bytes:
    answer = b""
    try:
        while part := client.recv(65536):
            answer += part
    except ConnectionError:
        pass
    return answer


def one_answer(client: socket.socket) -> bytes:
    """Return an answer whose body is a JSON object."""
    answer = b""
    while not answer.endswith(b"}"):
        answer += client.recv(65536)
    return answer


def status_of(answer: bytes) -> int:
    return int(answer.split(b" ", 2)[1]) if answer else 0


def problem_of(answer: bytes) -> str:
    head, _, body = answer.partition(b"\r\n\r\n")
    assert b"application/problem+json" in head and b"x-frame-options" in head
    return str(json.loads(body)["type"]).rpartition(":")[2]


@contextmanager
def serving(**limits_s: float) -> Iterator[Small]:
    """Run the server with other time limits [s], by name in ``http_limits``."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.support.small_service"],
        cwd=ROOT,
        env=os.environ | {name: str(value) for name, value in limits_s.items()},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    with process:
        try:
            assert process.stdout is not None
            small = Small(process, int(process.stdout.readline().rpartition(":")[2]))
            small.ask(NAME + LAST)
            yield small
        finally:
            process.kill()


@pytest.fixture(scope="module")
def small() -> Iterator[Small]:
    with serving() as one:
        yield one


@pytest.fixture(scope="module")
def strict() -> Iterator[Small]:
    """A server with short time limits."""
    with serving(HEAD_S=LIMIT_S, BODY_S=LIMIT_S) as one:
        yield one


def large_heads() -> dict[str, bytes]:
    """Return heads of three times the memory allowed; each breaks one way of counting."""
    n = 3 * MAX_GROWTH
    chunked = POST + b"Transfer-Encoding: chunked\r\n\r\n3\r\nabc\r\n"
    return {
        "one header": NAME + b"X: " + b"a" * n + b"\r\n\r\n",
        "a header that never ends": NAME + b"X: " + b"a" * n,
        "a name of a header": NAME + b"a" * n + b": x\r\n\r\n",
        "many headers": NAME + b"a: b\r\n" * (n // 6) + b"\r\n",
        "the URL": b"GET /" + b"a" * n + b" HTTP/1.1\r\n\r\n",
        "blank lines": b"\r\n" * (n // 2),
        "a handshake": b"GET /echo HTTP/1.1\r\n" + BEARER + UPGRADE + b"X: " + b"a" * n,
        "a trailer": chunked + b"0\r\nX: " + b"a" * n + b"\r\n\r\n",
        "an extension of a chunk": chunked + b"3;x=" + b"a" * n + b"\r\nabc\r\n0\r\n\r\n",
        "behind a request": NAME + b"\r\n" + NAME + b"X: " + b"a" * n,
    }


def test_endless_heads_are_refused_while_others_are_answered() -> None:
    with serving(LINGER_S=0.5) as small:  # each client sends on until then
        before, stop = small.peak_memory, threading.Event()
        meanwhile: list[int] = []

        def others() -> None:
            while not stop.is_set():
                meanwhile.append(status_of(small.ask(NAME + LAST)))
                time.sleep(0.01)

        thread = threading.Thread(target=others)
        thread.start()
        answers = {name: small.ask(head) for name, head in large_heads().items()}
        stop.set()
        thread.join()
        assert small.peak_memory - before < MAX_GROWTH
    assert set(meanwhile) == {200}
    behind = answers.pop("behind a request")
    assert behind.count(b"200 OK") == 1
    for name, answer in answers.items():
        assert (name, status_of(answer)) == (name, 431)
        assert problem_of(answer) == "head-too-large"


@pytest.mark.parametrize(("n_bytes", "status"), [(32_000, 200), (33_000, 431), (250_000, 431)])
def test_a_head_may_have_32_kib(small: Small, n_bytes: int, status: int) -> None:
    one = b"X: " + b"a" * (n_bytes - len(NAME)) + b"\r\n"
    many = b"a: bcd\r\n" * ((n_bytes - len(NAME)) // 8)
    assert status_of(small.ask(NAME + one + LAST)) == status
    assert status_of(small.ask(NAME + many + LAST)) == status


def test_a_large_but_legal_head_may_come_in_pieces(small: Small) -> None:
    head = NAME + b"X: " + b"a" * 20_000 + b"\r\n" + b"b: c\r\n" * 1000 + LAST
    with small.connect() as client:
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for start in range(0, len(head), 997):
            client.sendall(head[start : start + 997])
            time.sleep(0.001)
        assert status_of(rest_of(client)) == 200


def test_a_head_too_large_is_refused_before_the_token_is_looked_at(small: Small) -> None:
    head = b"GET /name HTTP/1.1\r\nHost: here\r\n"
    assert status_of(small.ask(head + LAST)) == 401
    assert status_of(small.ask(head + b"X: " + b"a" * 40_000 + b"\r\n" + LAST)) == 431


def drip(client: socket.socket, byte: bytes) -> bytes:
    """Send one byte after the other until the server answers."""
    client.settimeout(0.2)
    for _ in range(600):
        client.sendall(byte)
        try:
            answer = client.recv(65536)
        except TimeoutError:
            continue
        client.settimeout(120.0)
        return answer + rest_of(client)
    raise AssertionError("the server takes it without end")


def test_what_is_too_slow_ends(strict: Small) -> None:
    """Silence, a head and a body that stop or drip, on new and on used connections."""

    def ask(first: bytes, byte: bytes) -> int:
        with strict.connect() as client:
            client.sendall(first)
            if first.startswith(NAME):
                one_answer(client)
            return status_of(drip(client, byte) if byte else rest_of(client))

    body = POST + b"Content-Length: 100000\r\n\r\nabc"
    chunks = POST + b"Transfer-Encoding: chunked\r\n\r\n3\r\nabc\r\n"
    cases = {
        "silent": (b"", b""),
        "silent after a request": (NAME + b"\r\n", b""),
        "stops in the head": (b"GET / HT", b""),
        "drips a head": (b"GET / HTTP/1.1\r\nX: ", b"a"),
        "drips blank lines": (b"", b"\r\n"),
        "drips a head after a request": (NAME + b"\r\nGET /", b"a"),
        "drips a handshake": (b"GET /echo HTTP/1.1\r\n" + BEARER + UPGRADE + b"X: ", b"a"),
        "stops in the body": (body, b""),
        "drips a body": (body, b"a"),
        "drips chunks": (chunks, b"1\r\na\r\n"),
        "drips a trailer": (chunks + b"0\r\nX: ", b"a"),
        "drips a body that is refused": (body.replace(TOKEN.encode(), b"wrong"), b"a"),
    }
    with ThreadPoolExecutor(len(cases)) as pool:
        found = pool.map(ask, *zip(*cases.values(), strict=True))
        statuses = dict(zip(cases, found, strict=True))
    assert statuses.pop("silent") == statuses.pop("silent after a request") == 0
    assert statuses.pop("drips a body that is refused") == 401
    assert set(statuses.values()) == {408}, statuses
    assert status_of(strict.ask(NAME + LAST)) == 200


def test_body_that_never_ends_is_refused_although_it_progresses() -> None:
    with serving(BODY_S=0.5, BODY_BYTES=0, BODY_TOTAL_S=1.0) as one, one.connect() as client:
        client.sendall(POST + b"Content-Length: 1000000\r\n\r\n")
        answer = drip(client, b"a")
    assert status_of(answer) == 408
    assert b"the body was not complete after 1 s" in answer


def test_a_slow_answer_and_an_idle_socket_are_not_taken_for_slow_clients(strict: Small) -> None:
    with connect(
        f"ws://127.0.0.1:{strict.port}/echo",
        additional_headers={"Authorization": f"Bearer {TOKEN}"},
    ) as echo:
        time.sleep(LIMIT_S + 1.0)
        echo.send("still here")
        assert echo.recv() == "still here"


def test_a_long_body_is_taken_while_it_progresses(small: Small) -> None:
    n_bytes = 8 * MIB
    with small.connect() as client:
        client.sendall(POST + f"Content-Length: {n_bytes}\r\n".encode() + LAST)
        for _ in range(8):
            client.sendall(bytes(MIB))
            time.sleep(0.05)
        assert rest_of(client).endswith(b'{"length":8388608}')
    chunks = b"3\r\nabc\r\n" * 100_000 + b"0\r\n\r\n"
    answer = small.ask(POST + b"Transfer-Encoding: chunked\r\n" + LAST + chunks)
    assert answer.endswith(b'{"length":300000}')


def test_a_client_that_leaves_in_its_body_leaves_no_traceback() -> None:
    with serving() as small:
        for _ in range(3):
            with small.connect() as client:
                client.sendall(POST + b"Content-Length: 1000\r\n\r\nabc")
        assert status_of(small.ask(NAME + LAST)) == 200
        small.process.kill()
        assert small.process.stderr is not None
        assert "Traceback" not in small.process.stderr.read()


def test_a_body_without_a_reader_is_not_taken_without_end(small: Small) -> None:
    unproven = b"POST /length HTTP/1.1\r\nHost: here\r\nContent-Length: 50000000\r\n\r\n"
    assert status_of(small.ask(unproven + bytes(20_000_000))) == 401


def test_connections_are_kept_and_requests_pipelined(small: Small) -> None:
    with small.connect() as client:
        for k in range(5):
            client.sendall(NAME.replace(b"x=1", b"x=%d" % k) + b"\r\n")
            assert one_answer(client).endswith(b'{"x":"%d"}' % k)
        requests = [NAME.replace(b"x=1", b"x=%d" % k) for k in range(20)]
        client.sendall(b"\r\n".join(requests) + LAST)
        answers = rest_of(client)
    assert re.findall(rb'{"x":"(\d+)"}', answers) == [b"%d" % k for k in range(20)]


def test_more_pipelined_requests_than_are_taken_end_the_connection(small: Small) -> None:
    most, before = http_limits.MAX_PIPELINED + 1, small.peak_memory
    assert small.ask((NAME + b"\r\n") * (most + 8)).count(b"200 OK") == most
    # TCP drops answers on their way where the end of a connection leaves bytes unread.
    assert 0 < small.ask((NAME + b"\r\n") * 200_000).count(b"200 OK") <= most
    assert small.peak_memory - before < MAX_GROWTH


def test_answer_in_progress_is_finished_before_a_refusal_ends_the_connection(
    small: Small,
) -> None:
    slow = b"GET /slow HTTP/1.1\r\n" + BEARER + b"\r\n"
    for then in (NAME + b"X: " + b"a" * 40_000, b"nonsense\r\n\r\n"):
        answer = small.ask(slow + then)
        assert (answer.count(b"HTTP/1.1"), answer.count(b"piece")) == (1, 10)
        assert answer.endswith(b"0\r\n\r\n")


def test_what_is_no_http_is_a_problem(small: Small) -> None:
    for request in (b"nonsense\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n", b"\x16\x03\x01\x02\x00"):
        answer = small.ask(request)
        assert (status_of(answer), problem_of(answer)) == (400, "bad-request")


def test_a_handshake_beyond_the_limits_of_websockets_is_refused(small: Small) -> None:
    headers = {"Authorization": f"Bearer {TOKEN}"}
    address = f"ws://127.0.0.1:{small.port}/echo"
    with connect(address, additional_headers={**headers, "X": "a" * 7000}) as echo:
        echo.send("hello")
        assert echo.recv() == "hello"
    many = {f"X-{k}": "a" for k in range(200)}
    for more in ({"X": "a" * 9000}, {"X": "a" * 40_000}, many):
        with pytest.raises(InvalidStatus) as refused:
            connect(address, additional_headers={**headers, **more})
        assert refused.value.response.status_code == 431


@pytest.mark.parametrize(
    "more", [b"Sec-WebSocket-Protocol: \xc3\xa4\r\n", b"Connection: Upgrade, \xe4\r\n"]
)
def test_handshakes_that_cannot_be_decoded_are_refused_and_hold_no_connection(
    more: bytes,
) -> None:
    handshake = b"GET /echo HTTP/1.1\r\nHost: here\r\n" + UPGRADE + more + b"\r\n"
    with serving() as small:
        for _ in range(http_limits.MAX_CONNECTIONS + 20):
            answer = small.ask(handshake)
        assert (status_of(answer), problem_of(answer)) == (400, "bad-request")
        assert b"must be ASCII" in answer
        assert status_of(small.ask(NAME + LAST)) == 200
        small.process.terminate()
        _, log = small.process.communicate(timeout=60.0)
        assert "Traceback" not in log


def test_handshake_is_a_get_request(small: Small) -> None:
    answer = small.ask(b"POST /echo HTTP/1.1\r\n" + BEARER + UPGRADE + b"\r\n")
    assert status_of(answer) == 400 and b"is a GET request" in answer


def test_idle_connections_are_closed_for_new_ones() -> None:
    n_clients = http_limits.MAX_CONNECTIONS + 40
    with serving(HEAD_S=300.0) as small, ExitStack() as stack:  # none is closed for its age
        idle = [stack.enter_context(small.connect()) for _ in range(n_clients)]
        assert patient_http.get(
            f"http://127.0.0.1:{small.port}/name", headers={"Authorization": f"Bearer {TOKEN}"}
        ).is_success
        assert status_of(rest_of(idle[0])) == 503
        idle[-1].sendall(NAME + LAST)
        assert status_of(rest_of(idle[-1])) == 200


def test_a_client_that_reads_nothing_holds_an_answer_only_for_a_while() -> None:
    with serving(DRAIN_S=1.0) as small, small.connect() as client:
        client.sendall(b"GET /large HTTP/1.1\r\n" + BEARER + b"\r\n")
        time.sleep(3.0)
        assert len(rest_of(client)) < len(LARGE)
