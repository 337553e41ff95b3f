"""The panels on the right, of which each window sees one; what they and the left one leave is the actuator's."""

from __future__ import annotations

import threading

import viser

from emaviz.server.viser_private import Inside

LEFT_PX = 380
_USUAL_WINDOW_PX = 1400
_NARROWEST_PX, _WIDEST_PX = 340, 1000
TWO_COLUMNS_PX = 1240  # from which width on what stands in two columns does
# Widths by which windows are told apart: what is docked is laid out for the widest that is no wider than the window.
WINDOWS_PX = (900, 1000, 1100, 1200, TWO_COLUMNS_PX, 1300, 1400, 1500, 1600, 1700, 1800, 1900, 2100, 2300, 2600)
_SHOWN_S = 0.15


class Docked:
    """Panels that give way to each other, in each window for itself."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server, self._inside = server, Inside(server)
        self._panels: dict[str, tuple[viser.PanelHandle, float]] = {}  # by name, each with its share
        self._first = ""  # what a window sees at first
        self._seen: dict[int, str] = {}  # by window, where it is another one
        self._window_px: dict[int, int] = {}  # of `WINDOWS_PX`, by window, where it is not the usual

        @server.on_client_disconnect
        def _(client: viser.ClientHandle) -> None:
            self._window_px.pop(client.client_id, None)
            self._seen.pop(client.client_id, None)

    def add(self, name: str, share: float, *, in_front: bool = False) -> viser.PanelHandle:
        """A panel that takes this share of what the left one leaves of a window; in_front: windows begin with it.

        To be `dock`ed once it is built.
        """
        panel = self._server.gui.add_panel(visible=in_front)
        self._panels[name] = panel, share
        if in_front:
            self._first = name
        return panel

    def dock(self) -> None:
        """Puts all of them to the right, where later changes leave them."""
        for panel, share in self._panels.values():
            panel.dock_right()
            panel.set_width(_width_px(_USUAL_WINDOW_PX, share))

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

    def fit(self, client: int, window_px: int) -> None:
        """Lays one window out for its width, one of `WINDOWS_PX`."""
        if self._window_px.get(client, _USUAL_WINDOW_PX) != window_px:
            self._window_px[client] = window_px
            self._set_width(client)

    def _set_width(self, client: int) -> None:
        panel, share = self._panels[self._seen.get(client, self._first)]
        self._inside.set_width(client, panel, _width_px(self._window_px.get(client, _USUAL_WINDOW_PX), share))


def _width_px(window_px: int, share: float) -> int:
    """Of a panel."""
    return round(min(max(share * (window_px - LEFT_PX), _NARROWEST_PX), _WIDEST_PX))
