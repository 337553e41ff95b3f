"""The actuator as a picture: what a window's camera sees, as a PNG file."""

from __future__ import annotations

import struct
import zlib
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

_LONGEST_S = 30.0  # that a browser may take to draw it
_LEAST_PX = 16


def png(pixels: NDArray[np.uint8]) -> bytes:
    """The file of (height, width, 3) pixels."""
    height, width, _ = pixels.shape
    rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels.reshape(height, 3 * width)], axis=1)
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    parts = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 6)), (b"IEND", b""))
    chunks = (
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data)) for name, data in parts
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def send_picture(client: viser.ClientHandle, paper: tuple[int, int, int]) -> None:
    """Sends the window what it shows of the scene, on paper of that colour; not on the screen's thread: it waits."""
    camera: Any = client.camera
    size = (max(int(edge), _LEAST_PX) for edge in (camera.image_height, camera.image_width))
    drawn = client.get_render(*size, transport_format="png", timeout=_LONGEST_S).astype(float)
    cover = drawn[..., 3:] / 255.0
    whole = cover * drawn[..., :3] + (1.0 - cover) * np.array(paper, dtype=float)
    client.send_file_download("emaviz actuator.png", png(np.round(whole).astype(np.uint8)), save_immediately=True)
