"""A visitor of a viewer without a browser: speaks viser's protocol over its websocket."""

import threading
from collections.abc import Sequence
from types import TracebackType
from typing import Any, Self

import msgspec.msgpack
import viser
from websockets.sync.client import connect
from websockets.typing import Subprotocol


class ViewerClient:
    def __init__(self, port: int) -> None:
        self._socket = connect(
            f"ws://127.0.0.1:{port}",
            subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
            compression=None,
            max_size=None,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        # viser counts a visitor from its first camera on.
        self._send(
            type="ViewerCameraMessage",
            wxyz=(1.0, 0.0, 0.0, 0.0),
            position=(2.0, 0.0, 1.0),
            fov=0.7,
            near=0.01,
            far=100.0,
            image_height=600,
            image_width=800,
            look_at=(0.0, 0.0, 0.0),
            up_direction=(0.0, 0.0, 1.0),
        )

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
        for _ in self._socket:
            pass

    def _send(self, **message: Any) -> None:
        self._socket.send(msgspec.msgpack.encode(message))

    def click(self, name: str) -> None:
        self._send(
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
        self._send(type="TransformControlsDragStartMessage", name=name, owner="")
        for position in positions:
            self._send(
                type="TransformControlsUpdateMessage",
                name=name,
                wxyz=(1.0, 0.0, 0.0, 0.0),
                position=position,
                owner="",
            )
        self._send(type="TransformControlsDragEndMessage", name=name, owner="")
