"""The actuator as a picture: what a window's camera sees, as a PNG file."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

_LONGEST_S = 30.0  # that a browser may take to draw it
_LEAST_PX = 16


def png(pixels: NDArray[np.uint8]) -> bytes:
    """The file of (height, width, 3) pixels."""
    from PIL import Image  # first needed at a click

    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "PNG")
    return file.getvalue()


def send_picture(client: viser.ClientHandle, paper: tuple[int, int, int]) -> None:
    """Sends the window what it shows of the scene, on paper of that colour; not on the screen's thread: it waits."""
    camera: Any = client.camera
    size = (max(int(edge), _LEAST_PX) for edge in (camera.image_height, camera.image_width))
    try:
        drawn = client.get_render(*size, transport_format="png", timeout=_LONGEST_S).astype(float)
    except (RuntimeError, TimeoutError):  # the window was closed, does not draw, or sent no picture
        text = "The window has not sent its picture; bring it to the front, and press again."
        client.add_notification("No picture", text, auto_close_seconds=8.0, color="red")
        return
    cover = drawn[..., 3:] / 255.0
    whole = cover * drawn[..., :3] + (1.0 - cover) * np.array(paper, dtype=float)
    client.send_file_download("emaviz actuator.png", png(np.round(whole).astype(np.uint8)), save_immediately=True)
