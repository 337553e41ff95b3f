"""The panels on the right, of which each window sees one: wider where the window is."""

from __future__ import annotations

import threading

import viser

from emaviz.server.viser_private import Inside

LEFT_PX = 380
_USUAL_PX, _WIDE_PX = 500, 680
_WIDE_WINDOW_PX = 1750
_SHOWN_S = 0.15
_SETTLED_S = 2.0  # after which a browser that has connected knows the size of its picture


class Docked:
    """Panels that give way to each other, in each window for itself."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server, self._inside = server, Inside(server)
        self._panels: dict[str, tuple[viser.PanelHandle, int]] = {}  # by name, each with its px beyond the usual width
        self._first = ""  # what a window sees at first
        self._seen: dict[int, str] = {}  # by window, where it is another one
        self._wide: set[int] = set()  # windows

        @server.on_client_connect
        def _(client: viser.ClientHandle) -> None:
            timer = threading.Timer(_SETTLED_S, lambda: self._measure(client))
            timer.daemon = True
            timer.start()

        @server.on_client_disconnect
        def _(client: viser.ClientHandle) -> None:
            self._wide.discard(client.client_id)
            self._seen.pop(client.client_id, None)

    def add(self, name: str, wider_px: int = 0, *, in_front: bool = False) -> viser.PanelHandle:
        """A panel; in_front: windows begin with it.  To be `dock`ed once it is built."""
        panel = self._server.gui.add_panel(visible=in_front)
        self._panels[name] = panel, wider_px
        if in_front:
            self._first = name
        return panel

    def dock(self) -> None:
        """Puts all of them to the right, where later changes leave them."""
        for panel, more in self._panels.values():
            panel.dock_right()
            panel.set_width(_USUAL_PX + more)

    def show(self, client: int, name: str) -> None:
        """The panel that this window sees from now on; the others give way there."""
        before = self._seen.get(client, self._first)
        if before == name:
            return
        self._seen[client] = name
        self._inside.show_panel(client, self._panels[before][0], False)
        self._inside.show_panel(client, self._panels[name][0], True)
        # a panel that was hidden comes back narrow, and takes a width once it is there
        timer = threading.Timer(_SHOWN_S, self._set_width, (client,))
        timer.daemon = True
        timer.start()

    def _set_width(self, client: int) -> None:
        panel, more = self._panels[self._seen.get(client, self._first)]
        self._inside.set_width(client, panel, (_WIDE_PX if client in self._wide else _USUAL_PX) + more)

    def _measure(self, client: viser.ClientHandle) -> None:
        """Once, so that a panel that somebody draws wider later is left alone."""
        try:
            window = client.camera.image_width  # the picture lies behind the panels
        except Exception:  # gone again
            return
        if window >= _WIDE_WINDOW_PX:
            self._wide.add(client.client_id)
            self._set_width(client.client_id)
