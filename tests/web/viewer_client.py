"""A visitor of a viewer without a browser: speaks viser's protocol over its websocket."""

import random
import threading
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import msgspec.msgpack
import viser
import zstandard
from websockets.sync.client import unix_connect
from websockets.typing import Subprotocol

from tests.support.waiting import wait_until


def messages_of(frame: bytes) -> list[dict[str, Any]]:
    """Return the messages of one frame: two lengths, then zstd-packed msgpack, then arrays."""
    size = int.from_bytes(frame[8:16], "little")
    inner = zstandard.ZstdDecompressor().decompress(frame[16 : 16 + size])
    messages: list[dict[str, Any]] = msgspec.msgpack.decode(inner)["messages"]
    return messages


class ViewerClient:
    def __init__(self, address: Path) -> None:
        self._socket = unix_connect(
            str(address),
            subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
            compression=None,
            max_size=None,
        )
        self.received: list[dict[str, Any]] = []
        """What the viewer has sent, in order; arrays are placeholders."""
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        # viser counts a visitor from its first camera on.
        self.look(0.7)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._socket.close()
        self._reader.join(timeout=5.0)

    def _read(self) -> None:
        """Take what the viewer sends, or it would wait for us; ends with the socket."""
        for frame in self._socket:
            assert isinstance(frame, bytes)
            self.received.extend(messages_of(frame))

    def heard(self, kind: str) -> list[dict[str, Any]]:
        """Return the messages of a kind that came so far."""
        return [one for one in list(self.received) if one["type"] == kind]

    def shown(self) -> dict[str, bool]:
        """Return what of the scene's nodes is seen in this visitor's own scope, by name."""
        own = [one for one in self.heard("SetSceneNodeVisibilityMessage") if one["owner"]]
        return {one["name"]: one["visible"] for one in own}

    def check(self, label: str, value: bool) -> None:
        """Check or uncheck the box of that label."""
        boxes = self.heard("GuiCheckboxMessage")
        [box] = [one for one in boxes if one["props"]["label"] == label]
        self.send(type="GuiUpdateMessage", uuid=box["uuid"], updates={"value": value})

    def send(self, **message: Any) -> None:
        self._socket.send(msgspec.msgpack.encode(message))

    def wait_for(self, type: str, name: str) -> None:
        """Wait until a message of a type that concerns a node has come."""
        wait_until(lambda: any(one.get("name") == name for one in self.heard(type)))

    def look(self, fov: float) -> None:
        """Say where the camera is, with a field of view [rad]."""
        self.send(
            type="ViewerCameraMessage",
            wxyz=(1.0, 0.0, 0.0, 0.0),
            position=(2.0, 0.0, 1.0),
            fov=fov,
            near=0.01,
            far=100.0,
            image_height=600,
            image_width=800,
            look_at=(0.0, 0.0, 0.0),
            up_direction=(0.0, 0.0, 1.0),
        )

    def wait_until_heard(self, server: viser.ViserServer) -> None:
        """Wait until the server has handled all that was sent before."""
        fov = 0.5 + 0.1 * random.random()
        self.look(fov)
        wait_until(
            lambda: any(
                abs(one.camera.fov - fov) < 1e-9 for one in server.get_clients().values()
            )
        )

    def click(self, name: str) -> None:
        self.send(
            type="SceneNodeClickMessage",
            name=name,
            instance_index=None,
            ray_origin=(0.0, 0.0, 1.0),
            ray_direction=(0.0, 0.0, -1.0),
            screen_pos=(0.5, 0.5),
            modifier=None,
            owner="",
        )

    def drag(self, name: str, positions: Sequence[tuple[float, float, float]]) -> None:
        self.send(type="TransformControlsDragStartMessage", name=name, owner="")
        for position in positions:
            self.send(
                type="TransformControlsUpdateMessage",
                name=name,
                wxyz=(1.0, 0.0, 0.0, 0.0),
                position=position,
                owner="",
            )
        self.send(type="TransformControlsDragEndMessage", name=name, owner="")
