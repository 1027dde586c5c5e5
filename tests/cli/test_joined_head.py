"""Writes of an answer: its head leaves with the first part of its body."""

import asyncio

import pytest

from app.cli.joined_head import JoinedHead

HEAD = b"HTTP/1.1 200 OK\r\ncontent-length: 4\r\n\r\n"
STREAM = b"HTTP/1.1 200 OK\r\ntransfer-encoding: chunked\r\n\r\n"


class Writes(asyncio.Transport):
    """Records what is written to the system, call by call."""

    def __init__(self) -> None:
        super().__init__()
        self.calls: list[bytes] = []
        self.closed = False

    def write(self, data):
        self.calls.append(bytes(data))

    def writelines(self, list_of_data):
        self.calls.append(b"".join(list_of_data))

    def close(self):
        self.closed = True

    def is_closing(self):
        return self.closed


@pytest.fixture
def below() -> Writes:
    return Writes()


def test_head_and_body_leave_together_and_further_parts_at_once(below):
    joined = JoinedHead(below, has_body=True)
    joined.write(HEAD)
    assert below.calls == []
    joined.write(b"ab")
    joined.write(b"cd")
    assert below.calls == [HEAD + b"ab", b"cd"]


def test_an_empty_body_releases_the_head(below):
    joined = JoinedHead(below, has_body=True)
    joined.write(HEAD.replace(b"4", b"0"))
    joined.write(b"")
    assert below.calls == [HEAD.replace(b"4", b"0")]


@pytest.mark.parametrize(("head", "has_body"), [(STREAM, True), (HEAD, False)])
def test_a_head_that_no_body_need_follow_leaves_at_once(below, head, has_body):
    JoinedHead(below, has_body=has_body).write(head)
    assert below.calls == [head]


def test_an_interim_response_leaves_at_once_and_the_next_head_waits(below):
    joined = JoinedHead(below, has_body=True)
    joined.write(b"HTTP/1.1 100 Continue\r\n\r\n")
    joined.write(HEAD)
    assert below.calls == [b"HTTP/1.1 100 Continue\r\n\r\n"]


def test_a_closed_connection_has_sent_the_head(below):
    joined = JoinedHead(below, has_body=True)
    joined.write(HEAD)
    assert not joined.is_closing()
    joined.close()
    assert below.calls == [HEAD]
    assert joined.is_closing()
