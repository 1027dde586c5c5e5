"""Motion sockets over a real connection: deadlines, admission, and what a late request gets."""

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from app.api.motion.load import LOOP_HZ, MAX_SHARE, MAX_SOCKETS, MotionLoad, SocketRate
from app.api.schemas.examples import MOTION
from app.api.services import Services
from app.api.sockets import MAX_MESSAGE, MAX_MESSAGE_BYTES, TOO_LARGE
from app.main import create_app
from app.settings import Settings
from tests.api.live_server import running, wait_until_ready
from tests.support.waiting import wait_until

PATIENCE_S = 120.0
NEVER_MS = 10_000


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Services, str]]:
    app = create_app(Settings(data=tmp_path_factory.mktemp("motion")))
    with running(app) as (_, address):
        wait_until_ready(address)
        yield app.state.services, address.replace("http", "ws") + "/v1/motion/stream"


@pytest.fixture
def services(server: tuple[Services, str]) -> Iterator[Services]:
    """The parts of the running service, with the load of one that has just started."""
    found = server[0]
    wait_until(lambda: found.motion_load.share() == 0.0)
    found.motion_load = MotionLoad()
    yield found


@pytest.fixture
def url(server: tuple[Services, str]) -> str:
    return server[1]


@contextmanager
def decisions_held(services: Services) -> Iterator[None]:
    """Let no decision be made in this block, as on a server that is too slow."""
    with services.reach_policies.load(None)._busy:
        yield


def send(socket: ClientConnection, **changes: object) -> None:
    socket.send(json.dumps({**MOTION, **changes}))


def received(socket: ClientConnection) -> dict[str, Any]:
    answer: dict[str, Any] = json.loads(socket.recv(timeout=PATIENCE_S))
    return answer


def wait_until_deciding(services: Services) -> None:
    """Wait until a request is in the decision that is held."""
    wait_until(services.motion_load.turn.locked)


def close_of(socket: ClientConnection) -> tuple[int, str]:
    with pytest.raises(ConnectionClosed):
        socket.recv(timeout=PATIENCE_S)
    assert socket.close_code is not None
    return socket.close_code, socket.close_reason or ""


@pytest.mark.usefixtures("services")
def test_longest_message_is_read_and_a_longer_one_is_answered_by_a_problem(url: str) -> None:
    longest = json.dumps({"cell": "\U0001f9be" * (MAX_MESSAGE - 12)}, ensure_ascii=False)
    assert len(longest) == MAX_MESSAGE and len(longest.encode()) > 3 * MAX_MESSAGE
    with connect(url) as socket:
        for message, status in ((longest, 422), (longest + " ", 413)):
            socket.send(message)
            assert received(socket)["status"] == status


@pytest.mark.usefixtures("services")
def test_message_beyond_what_is_received_closes_its_socket(url: str) -> None:
    with connect(url) as other, connect(url) as socket:
        socket.send(" " * (MAX_MESSAGE_BYTES + 1))
        assert close_of(socket)[0] == TOO_LARGE
        send(other, stamp=1)
        assert received(other)["stamp"] == 1


@pytest.mark.usefixtures("services")
def test_answer_says_how_its_request_was_served(url: str) -> None:
    with connect(f"{url}?deadline_ms={NEVER_MS}") as socket:
        send(socket, stamp=1)
        stream = received(socket)["stream"]
    assert stream.pop("waited_ms") >= 0.0
    assert stream == {"missed_deadline": False, "superseded": 0, "left_out": []}


class SlowReading:
    """The reading of the cell and the checkpoint ``slow``, which ends when it is released."""

    def __init__(self, services: Services, monkeypatch: pytest.MonkeyPatch) -> None:
        self.began, self.release = threading.Event(), threading.Event()
        for place, name in ((services.cells, "get"), (services.reach_policies, "load")):
            monkeypatch.setattr(place, name, partial(self._read, getattr(place, name)))

    def _read(self, read: Callable[[str | None], object], name: str | None) -> object:
        if name == "slow":
            self.began.set()
            assert self.release.wait(PATIENCE_S)
        return read(name)


@pytest.mark.parametrize("member", ["cell", "checkpoint"])
def test_objects_that_one_client_names_are_read_beside_the_decisions_of_others(
    services: Services, url: str, monkeypatch: pytest.MonkeyPatch, member: str
) -> None:
    slow = SlowReading(services, monkeypatch)
    with connect(url) as one, connect(url) as other:
        for _ in range(2):  # unknown ones are looked for each time
            slow.began.clear()
            slow.release.clear()
            send(one, **{member: "slow"})
            assert slow.began.wait(PATIENCE_S)
            send(other, stamp="other")
            assert received(other)["stamp"] == "other"
            slow.release.set()
            refused = received(one)
            assert (refused["status"], refused["field"]) == (422, member)


def test_request_that_arrives_during_the_reading_is_answered_with_its_own_cell(
    services: Services, url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow = SlowReading(services, monkeypatch)
    with connect(url) as socket, connect(url) as other:
        send(socket, cell="slow")
        assert slow.began.wait(PATIENCE_S)
        send(socket, stamp="newer")
        send(other)
        received(other)  # the server has received the newer request, too
        slow.release.set()
        newer = received(socket)
        assert (newer["stamp"], newer["stream"]["superseded"]) == ("newer", 1)
        assert newer["segment"] is not None


def test_only_the_newest_request_of_a_client_is_answered(services: Services, url: str) -> None:
    with connect(url) as socket, connect(url) as other:
        with decisions_held(services):
            send(socket, stamp=0)
            wait_until_deciding(services)
            for k in range(1, 10):
                send(socket, stamp=k)
            send(other, stamp="other")
        first, second = received(socket), received(socket)
        assert (first["stamp"], first["stream"]["superseded"]) == (0, 0)
        assert (second["stamp"], second["stream"]["superseded"]) == (9, 8)
        assert received(other)["stream"]["superseded"] == 0


def test_each_request_is_answered_in_order_where_the_client_asks_so(
    services: Services, url: str
) -> None:
    with connect(f"{url}?answer=each") as socket:
        with decisions_held(services):
            for k in range(100):
                send(socket, stamp=k)
        found = [received(socket) for _ in range(100)]
    assert [one["stamp"] for one in found] == list(range(100))
    assert {one["stream"]["superseded"] for one in found} == {0}


def test_a_late_request_is_answered_without_search_and_rollout(url: str) -> None:
    with connect(f"{url}?deadline_ms=0.0001") as socket:
        send(socket, elapsed_s=2.0)
        late = received(socket)
        assert late["stream"]["missed_deadline"]
        assert late["stream"]["left_out"] == ["search", "rollout"]
        assert not late["rollout"] and late["safety"] is not None
        send(socket, rollout=True)
        asked = received(socket)
        assert asked["rollout"] and asked["stream"]["left_out"] == []


def test_problem_says_how_its_request_was_served(url: str) -> None:
    with connect(url) as socket:
        socket.send("{")
        assert received(socket)["stream"]["superseded"] == 0


def test_socket_beyond_the_measured_capacity_is_refused_with_the_reason(
    services: Services, url: str
) -> None:
    load = services.motion_load
    load.decision_s = 0.6 * MAX_SHARE / LOOP_HZ
    with connect(url) as first:
        send(first)
        assert received(first)["stamp"] is None
        load.decision_s = 0.6 * MAX_SHARE / LOOP_HZ
        with connect(url) as second:
            code, reason = close_of(second)
        assert code == 1013
        assert reason == (
            "motion sockets use 55 % of the time for decisions (1 are open); one more would "
            "exceed 92 %"
        )
        load.decision_s = 0.4 * MAX_SHARE / LOOP_HZ
        with connect(url) as second:
            send(second, stamp="admitted")
            assert received(second)["stamp"] == "admitted"


def test_idle_socket_does_not_count_but_their_number_is_limited() -> None:
    load = MotionLoad()
    for _ in range(MAX_SOCKETS):
        assert load.refusal() is None
        load.add(SocketRate(opened=0.0))
    assert load.share() == 0.0
    assert load.refusal() == "64 motion sockets are open already: close one of them"


def test_shortened_decisions_do_not_make_room_for_more_sockets() -> None:
    load, socket = MotionLoad(decision_s=2e-3), SocketRate()
    for _ in range(100):
        load.note(socket, 1e-4, whole=False)
    assert load.decision_s == 2e-3
    for _ in range(100):
        load.note(socket, 1e-4, whole=True)
    assert 1e-4 < load.decision_s < 1e-3


def test_idle_socket_is_closed(services: Services, url: str) -> None:
    services.motion_load.idle_s = 0.3
    with connect(url) as socket:
        assert close_of(socket) == (1008, "no request for 0.3 s")


@pytest.mark.parametrize(
    ("query", "reason"),
    [
        ("answer=all", "answer = 'all' must be one of the choices; choices: newest, each"),
        ("deadline_ms=0", "deadline_ms = '0' must be above 0"),
        ("deadline_ms=nan", "deadline_ms = 'nan' must be a finite number"),
        ("deadline_ms=soon", "deadline_ms = 'soon' must be a valid number"),
        ("deadline_ms=1_0", "deadline_ms = '1_0' must be a number in plain digits"),
        ("deadline_ms=5&deadline_ms=50", "deadline_ms = ['5', '50'] must be given once"),
        ("anwser=each", "anwser = 'each' is not a parameter; choices: answer, deadline_ms"),
    ],
)
def test_bad_parameter_of_a_socket_is_named(url: str, query: str, reason: str) -> None:
    with connect(f"{url}?{query}") as socket:
        code, text = close_of(socket)
    assert code == 1008 and text.startswith(reason)


def test_client_that_leaves_while_its_request_is_decided_is_forgotten(
    services: Services, url: str
) -> None:
    with decisions_held(services):
        socket = connect(url)
        send(socket)
        wait_until_deciding(services)
        threading.Thread(target=socket.close).start()
    wait_until(lambda: services.motion_load.n_open == 0)
