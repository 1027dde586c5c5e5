from collections.abc import Iterator

import msgspec
import pytest
import viser
from fastapi.testclient import TestClient
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin, Subprotocol

from app.api.viewer import is_allowed
from app.main import create_app
from app.settings import Settings
from tests.api.live_server import running, wait_until_ready

PROTOCOL = Subprotocol(f"viser-v{viser.__version__}")


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    app = create_app(Settings(data=tmp_path_factory.mktemp("viewer")))
    with running(app) as (_, found):
        wait_until_ready(found)
        yield found


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


def test_unknown_world_has_no_socket(address: str) -> None:
    with pytest.raises(InvalidStatus):
        open_socket(address, path="/viewer/other")


def test_request_for_a_public_tunnel_never_reaches_the_viewer(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[object] = []
    monkeypatch.setattr(viser.ViserServer, "request_share_url", lambda *_: asked.append(1))
    with open_socket(address) as socket:
        socket.recv(timeout=10.0)
        for frame in ({"type": "ShareUrlRequest"}, {"type": "ShareUrlDisconnect"}):
            socket.send(msgspec.msgpack.encode(frame))
        socket.send(b"\xc1 no msgpack")
        socket.send("text")
        assert isinstance(socket.recv(timeout=10.0), bytes)
    assert not asked


@pytest.mark.parametrize(
    ("frame", "allowed"),
    [
        (msgspec.msgpack.encode({"type": "ViewerCameraMessage", "fov": 1.0}), True),
        (msgspec.msgpack.encode({"type": "ShareUrlRequest"}), False),
        (msgspec.msgpack.encode({"x": 1}), False),
        (msgspec.msgpack.encode([{"type": "ViewerCameraMessage"}]), False),
        (b"\x82\xa4type\xa1A\xa4type\xafShareUrlRequest", False),
        (b"", False),
        (b"\x91" * 100_000, False),
    ],
)
def test_frames_are_let_through_by_the_type_that_the_viewer_reads(
    frame: bytes, allowed: bool
) -> None:
    assert is_allowed(frame) is allowed
