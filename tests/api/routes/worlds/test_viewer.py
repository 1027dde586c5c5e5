import time
from contextlib import ExitStack
from pathlib import Path

import msgspec
import pytest
import viser
from fastapi.testclient import TestClient
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin, Subprotocol

from app.api.routes.viewer import is_allowed
from app.api.services import MAX_VIEWERS
from app.api.sockets import MAX_MESSAGE, MAX_MESSAGE_BYTES
from app.main import create_app
from app.settings import Settings
from tests.api.live_server import running, wait_until_ready
from tests.support import patient_http
from tests.support.listening_ports import listening_ports

TOKEN = "a-token-of-some-length"
PROTOCOL = Subprotocol(f"viser-v{viser.__version__}")


def open_socket(
    address: str, path: str = "/viewer/main", **options: object
) -> ClientConnection:
    url = address.replace("http://", "ws://") + path
    return connect(url, subprotocols=[PROTOCOL], max_size=None, proxy=None, **options)  # type: ignore[arg-type]


def test_page_of_the_viewer_hides_what_confuses(client: TestClient) -> None:
    page = client.get("/viewer/main/")
    assert page.headers["content-type"].startswith("text/html")
    assert "#webgl-software-rendering" in page.text
    assert "connect-src 'self'" in page.headers["content-security-policy"]


def test_page_of_the_viewer_is_found_without_the_slash(client: TestClient) -> None:
    answer = client.get("/viewer/main", follow_redirects=False)
    assert answer.headers["location"] == "/viewer/main/"


def test_viewer_of_an_unknown_world_is_not_found(client: TestClient) -> None:
    assert client.get("/viewer/other/").status_code == 404


def test_socket_speaks_the_viewers_protocol_and_sends_the_scene(address: str) -> None:
    with open_socket(address) as socket:
        assert socket.subprotocol == PROTOCOL
        frame = socket.recv(timeout=10.0)
        assert isinstance(frame, bytes)
        size = int.from_bytes(frame[8:16], "little")
        assert len(frame) >= 16 + size


def test_client_of_another_version_is_sent_away_as_by_the_viewer(address: str) -> None:
    url = address.replace("http://", "ws://") + "/viewer/main"
    with connect(url, subprotocols=[Subprotocol("viser-v0.0.1")], proxy=None) as socket:
        with pytest.raises(Exception, match="1002"):
            socket.recv(timeout=10.0)


def test_foreign_page_gets_no_socket(address: str) -> None:
    with pytest.raises(InvalidStatus) as refused:
        open_socket(address, origin=Origin("http://evil.example"))
    assert refused.value.response.status_code == 403


def test_unknown_world_has_no_socket_and_says_so(address: str) -> None:
    with open_socket(address, path="/viewer/other") as socket:
        with pytest.raises(ConnectionClosed) as refused:
            socket.recv(timeout=10.0)
    assert refused.value.rcvd is not None
    assert (refused.value.rcvd.code, refused.value.rcvd.reason) == (1013, "no such world yet")


def test_request_for_a_public_tunnel_never_reaches_the_viewer(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[object] = []
    monkeypatch.setattr(viser._viser, "ViserTunnel", lambda *_: asked.append(1))
    with open_socket(address) as socket:
        socket.recv(timeout=10.0)
        for frame in ({"type": "ShareUrlRequest"}, {"type": "ShareUrlDisconnect"}):
            socket.send(msgspec.msgpack.encode(frame))
        socket.send(b"\xc1 no msgpack")
        socket.send("text")
        assert isinstance(socket.recv(timeout=10.0), bytes)
    assert not asked


def test_only_the_service_itself_listens_and_asks_viewers_for_its_token(tmp_path: Path) -> None:
    before = listening_ports()
    app = create_app(Settings(data=tmp_path, token=TOKEN))  # type: ignore[arg-type]
    with running(app) as (_, found):
        bearer = {"Authorization": f"Bearer {TOKEN}"}
        wait_until_ready(found, bearer)
        assert listening_ports() - before == {int(found.rsplit(":", 1)[1])}
        people = patient_http.get(f"{found}/v1/worlds/main", headers=bearer).json()["people"]
        for options in ({}, {"origin": Origin("http://evil.example")}):
            with pytest.raises(InvalidStatus):
                with open_socket(found, **options) as stranger:
                    stranger.send(drag_of_the_pelvis())
        assert patient_http.get(f"{found}/viewer/main/").status_code == 401
        now = patient_http.get(f"{found}/v1/worlds/main", headers=bearer).json()["people"]
        assert [one["mode"] for one in now] == [one["mode"] for one in people] == ["auto"]
        with open_socket(found, additional_headers=bearer) as visitor:
            assert isinstance(visitor.recv(timeout=10.0), bytes)


def drag_of_the_pelvis() -> bytes:
    return msgspec.msgpack.encode(
        {
            "type": "TransformControlsUpdateMessage",
            "name": "/gizmos/0/pelvis",
            "wxyz": (1.0, 0.0, 0.0, 0.0),
            "position": (0.0, 2.0, 0.0),
            "owner": "",
        }
    )


def test_viewer_beyond_the_limit_gets_the_reason_and_connects_once_another_has_left(
    address: str,
) -> None:
    with ExitStack() as stack:
        first, *_ = [stack.enter_context(open_socket(address)) for _ in range(MAX_VIEWERS)]
        with pytest.raises(ConnectionClosed, match="16 viewers are open already") as refused:
            stack.enter_context(open_socket(address)).recv(timeout=10.0)
        assert refused.value.rcvd is not None and refused.value.rcvd.code == 1013
        first.close()
        assert isinstance(enter_when_free(address, stack).recv(timeout=10.0), bytes)


def enter_when_free(address: str, stack: ExitStack) -> ClientConnection:
    """Return a viewer that was let in; the server learns of a leave a moment later."""
    for _ in range(100):
        one = stack.enter_context(open_socket(address))
        try:
            one.recv(timeout=10.0)
        except ConnectionClosed:
            time.sleep(0.1)
            continue
        return one
    raise AssertionError("nobody is let in")


@pytest.mark.parametrize(
    "frame",
    [
        b"\x91" * (MAX_MESSAGE_BYTES + 1),
        b"\x91" * MAX_MESSAGE_BYTES,
        msgspec.msgpack.encode({"type": "ViewerCameraMessage", "x": b"0" * MAX_MESSAGE}),
        "text" * (MAX_MESSAGE // 4 + 1),
    ],
    ids=["more than is received", "nested arrays", "camera of 64 KiB and a little", "text"],
)
def test_frame_that_is_too_large_ends_its_own_connection_only(
    address: str, frame: bytes | str
) -> None:
    """A frame that is not read to its end may reset the connection before the code arrives."""
    with open_socket(address) as other, open_socket(address) as socket:
        with pytest.raises(ConnectionClosed) as closed:
            socket.send(frame)
            while True:
                socket.recv(timeout=10.0)
        code = None if closed.value.rcvd is None else closed.value.rcvd.code
        assert code == 1009 or (code is None and len(frame) > MAX_MESSAGE_BYTES)
        assert isinstance(other.recv(timeout=10.0), bytes)


def moved(**vectors: object) -> bytes:
    return msgspec.msgpack.encode({"type": "TransformControlsUpdateMessage", **vectors})


@pytest.mark.parametrize(
    ("frame", "allowed"),
    [
        (msgspec.msgpack.encode({"type": "ViewerCameraMessage", "fov": 1.0}), True),
        (moved(position=[0.1, 0.2, 3], wxyz=[1.0, 0.0, 0.0, 0.0]), True),
        (moved(position=[0.1]), False),
        (moved(position=0.1), False),
        (moved(position=[0.1, 0.2, "3"]), False),
        (moved(position=[0.1, 0.2, True]), False),
        (moved(position=[0.1, 0.2, float("nan")]), False),
        (moved(wxyz=[1.0, 0.0, 0.0, float("inf")]), False),
        (moved(wxyz=[1.0, 0.0, 0.0]), False),
        (moved(ray_origin=None), True),
        (moved(position=None), False),
        (moved(wxyz=None), False),
        (msgspec.msgpack.encode({"type": "ShareUrlRequest"}), False),
        (msgspec.msgpack.encode({"x": 1}), False),
        (msgspec.msgpack.encode([{"type": "ViewerCameraMessage"}]), False),
        (b"\x82\xa4type\xa1A\xa4type\xafShareUrlRequest", False),
        (b"", False),
        (b"\x91" * 50_000, False),
        (b"\x91" * 100_000, False),
        (msgspec.msgpack.encode({"type": "FileTransferStartUpload"}), False),
        (msgspec.msgpack.encode({"type": None}), False),
        (msgspec.msgpack.encode({"type": ["ViewerCameraMessage"]}), False),
        (msgspec.msgpack.encode({"type": "GetRenderResponseMessage"}), False),
    ],
)
def test_frames_are_let_through_by_the_type_that_the_viewer_reads(
    frame: bytes, allowed: bool
) -> None:
    assert is_allowed(frame) is allowed
