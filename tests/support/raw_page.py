"""A page without a browser: speaks to the server message by message, so that it can also say what no browser says."""

from __future__ import annotations

import socket
import threading
from contextlib import suppress
from typing import Any

import msgspec
import viser
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [1.0, 0.0, 0.0],
    "fov": 1.2,
    "near": 0.01,
    "far": 1000.0,
    "image_height": 650,
    "image_width": 1000,
    "look_at": [0.0, 0.0, 0.0],
    "up_direction": [0.0, 0.0, 1.0],
}


class RawPage:
    """One connection; `values` and `props` hold what the server says of every control, by its id."""

    def __init__(self, port: int, camera: bool = True, host: str = "127.0.0.1", token: str = "") -> None:
        """host: the name in its address bar; camera: whether it counts as a page, as a browser's does at once."""
        self.values: dict[str, Any] = {}
        self.said: list[dict[str, Any]] = []  # other messages of the server that tests look at
        self.asked_for_a_picture: list[str] = []  # ids of the requests
        self.drawn, self.closed = threading.Event(), threading.Event()
        self._plug = connect(
            f"ws://{host}:{port}/?token={token}",
            sock=socket.create_connection(("127.0.0.1", port), timeout=10.0),
            origin=Origin(f"http://{host}:{port}"),
            subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
            compression=None,
            max_size=None,
            proxy=None,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        if camera:
            self.send(CAMERA)

    def send(self, message: Any) -> None:
        """A message, or bytes or text as they are."""
        self._plug.send(message if isinstance(message, (bytes, str)) else msgspec.msgpack.encode(message))

    def update(self, uuid: Any, value: Any, prop: Any = "value") -> None:
        """What a control sends when it is moved."""
        self.send({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {prop: value}})

    def told(self) -> list[str]:
        """The texts of the notifications so far."""
        return [one["props"]["body"] for one in self.said if one["type"] == "NotificationShowMessage"]

    def close(self) -> None:
        """Leaves."""
        with suppress(ConnectionClosed):
            self._plug.close()
        self._reader.join(10.0)

    def __enter__(self) -> RawPage:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _read(self) -> None:
        with suppress(ConnectionClosed):
            for frame in self._plug:
                assert isinstance(frame, bytes)
                size = int.from_bytes(frame[8:16], "little")
                for message in msgspec.msgpack.decode(zstandard.decompress(frame[16 : 16 + size]))["messages"]:
                    self._take(message)
        self.closed.set()

    def _take(self, message: dict[str, Any]) -> None:
        kind = message["type"]
        if kind == "ReplayDoneMessage":
            self.drawn.set()
        elif kind == "GuiUpdateMessage" and "value" in message["updates"]:
            self.values[message["uuid"]] = message["updates"]["value"]
            self.said.append(message)
        elif kind.startswith("Gui") and "value" in message:
            self.values[message["uuid"]] = message["value"]
        elif kind == "GetRenderRequestMessage":
            self.asked_for_a_picture.append(message["render_uuid"])
        elif kind == "NotificationShowMessage":
            self.said.append(message)
