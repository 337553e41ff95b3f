"""The panels on the right, of which one is seen: wider where every open browser is."""

from __future__ import annotations

import threading

import viser

LEFT_PX = 380
_USUAL_PX, _WIDE_PX = 500, 680
_VIEWER_MORE_PX = 140  # the Rerun viewer needs more
_WIDE_WINDOW_PX = 1750
_SHOWN_S = 0.15
_SETTLED_S = 2.0  # after which a browser that has connected knows the size of its picture


class Docked:
    """Panels that give way to each other; `add` makes one, the first is in front."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._panels: list[tuple[viser.PanelHandle, int]] = []  # each with its px beyond the usual width
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

    def add(self, *, viewer: bool = False) -> viser.PanelHandle:
        """A panel; viewer: it is to hold the Rerun viewer.  To be `dock`ed once it is built."""
        panel = self._server.gui.add_panel(visible=not self._panels)
        self._panels.append((panel, _VIEWER_MORE_PX if viewer else 0))
        return panel

    def dock(self) -> None:
        """Puts all of them to the right, where later changes leave them."""
        for panel, more in self._panels:
            panel.dock_right()
            panel.set_width(self._usual + more)

    def bring(self, panel: viser.PanelHandle) -> None:
        """To the front; the others give way."""
        for one, more in self._panels:
            if one is not panel:
                if one.visible:
                    one.visible = False
            elif not one.visible:
                one.visible = True
                # a panel that was hidden comes back narrow, and takes a width once it is there
                threading.Timer(_SHOWN_S, one.set_width, (self._usual + more,)).start()

    @property
    def _usual(self) -> int:
        return _WIDE_PX if self._wide else _USUAL_PX

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
            for panel, more in self._panels:
                if panel.visible:
                    panel.set_width(self._usual + more)
