"""How wide the panels on the right are: wider where every open browser is."""

from __future__ import annotations

import threading
from collections.abc import Callable

import viser

LEFT_PX = 380
_USUAL_PX, _WIDE_PX = 500, 680
_VIEWER_MORE_PX = 140  # the Rerun viewer needs more
_WIDE_WINDOW_PX = 1750
_SETTLED_S = 2.0  # after which a browser that has connected knows the size of its picture


class Widths:
    """changed(): the widths are others now; called on a thread of its own."""

    def __init__(self, server: viser.ViserServer, changed: Callable[[], None]) -> None:
        self._changed = changed
        self._windows: dict[int, float] = {}  # px, by browser
        self._wide = False

        @server.on_client_connect
        def _(client: viser.ClientHandle) -> None:
            timer = threading.Timer(_SETTLED_S, lambda: self._measure(client))
            timer.daemon = True
            timer.start()

        @server.on_client_disconnect
        def _(client: viser.ClientHandle) -> None:
            self._windows.pop(client.client_id, None)
            self._decide()

    def of(self, viewer: bool) -> int:
        """px, of a panel on the right; viewer: of the one with the Rerun viewer."""
        return (_WIDE_PX if self._wide else _USUAL_PX) + (_VIEWER_MORE_PX if viewer else 0)

    def _measure(self, client: viser.ClientHandle) -> None:
        """Once, so that a panel that somebody draws wider later is left alone."""
        try:
            window = client.camera.image_width  # the picture lies behind the panels
        except Exception:  # gone again
            return
        if window > 0:
            self._windows[client.client_id] = window
            self._decide()

    def _decide(self) -> None:
        wide = bool(self._windows) and min(self._windows.values()) >= _WIDE_WINDOW_PX
        if self._windows and wide != self._wide:
            self._wide = wide
            self._changed()
