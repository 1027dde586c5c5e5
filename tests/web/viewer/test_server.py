"""A viewer's own socket: without a share tunnel, gone with its server, beside others."""

import tempfile
from pathlib import Path

import pytest
import viser
from websockets.sync.client import unix_connect

from tests.web.viewer_client import ViewerClient
from web.viewer.server import ViewerServer


def test_request_for_a_public_tunnel_has_no_handler(monkeypatch: pytest.MonkeyPatch) -> None:
    tunnels: list[object] = []
    monkeypatch.setattr(viser._viser, "ViserTunnel", lambda *_: tunnels.append(1))
    server = ViewerServer()
    with ViewerClient(server.address) as visitor:
        visitor.send(type="ShareUrlRequest")
        visitor.send(type="ShareUrlDisconnect")
        visitor.wait_until_heard(server)
    assert server.request_share_url() is None
    server.stop()
    assert not tunnels


def test_stop_removes_the_socket() -> None:
    server = ViewerServer()
    assert server.address.exists()
    server.stop()
    assert not server.address.parent.exists()


def test_two_viewers_and_a_server_on_a_port_do_not_mix() -> None:
    first, second = ViewerServer(), ViewerServer()
    plain = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    assert first.address != second.address
    assert plain.get_port() > 0
    first.stop()
    with pytest.raises(OSError):
        unix_connect(str(first.address))
    with ViewerClient(second.address) as visitor:
        visitor.wait_until_heard(second)
    second.stop()
    plain.stop()


def test_address_that_cannot_be_made_is_an_error_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    long = tmp_path / ("x" * 120)
    long.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(long))
    with pytest.raises(OSError, match="too long"):
        ViewerServer()
