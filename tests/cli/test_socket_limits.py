"""Limits of WebSocket connections, asked of a server in a process of its own."""

import socket
import time
from contextlib import suppress

from tests.cli.test_http_limits import BEARER, MAX_GROWTH, MIB, UPGRADE, serving


def test_socket_whose_client_reads_nothing_is_ended() -> None:
    with serving(DRAIN_S=1.0) as small, small.connect() as client:
        client.sendall(b"GET /flood HTTP/1.1\r\n" + BEARER + UPGRADE + b"\r\n")
        time.sleep(6.0)
        n_bytes = 0
        with suppress(ConnectionError):
            while n_bytes < 64 * MIB and (part := client.recv(65536)):
                n_bytes += len(part)
        assert 0 < n_bytes < 64 * MIB  # it ends, although the service sends without end


def test_pings_of_a_client_that_reads_nothing_are_not_kept() -> None:
    ping = b"\x89\xfd" + bytes(4) + bytes(125)
    with serving(DRAIN_S=600.0) as small, small.connect() as client:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        client.sendall(b"GET /echo HTTP/1.1\r\n" + BEARER + UPGRADE + b"\r\n")
        assert client.recv(1024).startswith(b"HTTP/1.1 101")
        before = small.peak_memory
        with suppress(ConnectionError):  # it answers no ping of the server either
            for _ in range(40):  # 42 MB of answers
                client.sendall(ping * 8192)
        assert small.peak_memory - before < MAX_GROWTH
