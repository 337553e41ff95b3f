"""The inside of viser 1.1 that the app needs, all of it here."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
import viser
from viser import _gui_api, _gui_handles, _icons, _messages
from viser._messages import FileTransferPart as TransferPart
from viser._messages import FileTransferStartUpload as TransferStart
from websockets.datastructures import Headers


def id_of(control: Any) -> str:
    """The id of what shows a control in the page."""
    return control._impl.uuid


def selector_of(control: Any) -> str:
    """What a style rule calls it."""
    return f'[id="{id_of(control)}"]'


def in_single_precision(chart: Any) -> Any:
    """A live chart whose numbers are sent in four bytes each: viser casts what is assigned by its declared types."""
    chart.__dict__["_prop_hints"] = {**chart._prop_hints, "data": tuple[npt.NDArray[np.float32], ...]}
    return chart


def keep_icons() -> None:
    """Icons are read once: viser opens its archive of 5,000, most of a tenth of a second, for each of ours again."""
    _gui_api.svg_from_icon = _gui_handles.svg_from_icon = _icon  # type: ignore[assignment]


@cache
def _icon(name: str) -> str:
    return _archive().read(f"{name}.svg").decode()


@cache
def _archive() -> zipfile.ZipFile:
    return zipfile.ZipFile(_icons.ICONS_DIR / "tabler-icons.zip")


class Inside:
    """What a server knows of its pages and controls."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server

    def client(self, connection: Any) -> int | None:
        """The number of the page on this websocket, while it is open."""
        return next(
            (one for one, plug in list(self._server._websock_server._live_connections.items()) if plug is connection),
            None,
        )

    def headers(self, client: int) -> Headers:
        """With which this page's websocket was asked for."""
        plug = self._server._websock_server._live_connections.get(client)
        return plug.request.headers if plug is not None and plug.request is not None else Headers()

    def control(self, client: int | None, uuid: str) -> Any:
        """The control that this page shows under this id, or None."""
        found = (gui._gui_input_handle_from_uuid.get(uuid) for gui in self._guis(client))
        return next((one for one in found if one is not None and not one._impl.removed), None)

    def lets_at(self, control: Any) -> bool:
        """Whether a page lets its user at this control: it can be used, and all that it stands in is shown."""
        if control is None or getattr(control, "disabled", False):
            return False
        gui, inside = control._impl.gui_api, control
        while inside is not None and not isinstance(inside, viser.PanelHandle):  # as each window shows it
            if not getattr(inside, "visible", True):
                return False
            if isinstance(inside, viser.GuiTabHandle):
                inside = inside._parent
            elif (state := getattr(inside, "_impl", None)) is None:  # the page itself, or a window on it
                return True
            else:
                inside = gui._container_handle_from_uuid.get(getattr(state, "parent_container_id", ""))
        return True

    def has_form(self, client: int | None, uuid: str) -> bool:
        """Whether this page shows such a form."""
        found = (gui._container_handle_from_uuid.get(uuid) for gui in self._guis(client))
        return any(isinstance(one, viser.GuiFormHandle) for one in found)

    def has_node(self, client: int | None, name: str) -> bool:
        """Whether this page's scene has such a node."""
        page = self._server.get_clients().get(client) if client is not None else None
        scenes = [self._server.scene] + ([page.scene] if page else [])
        return any(scene._handle_from_node_name.get(name) is not None for scene in scenes)

    def send_value(self, client: int | None, control: Any) -> None:
        """Tells one page what a control's value is."""
        state = self._server._websock_server._client_state_from_id.get(-1 if client is None else client)
        if state is not None and not control._impl.is_button:
            state.message_buffer.push(_messages.GuiUpdateMessage(control._impl.uuid, {"value": control.value}))

    def show_panel(self, client: int, panel: viser.PanelHandle, visible: bool, width_px: int | None = None) -> None:
        """Shows a panel in one page alone, or hides it there; every other page keeps its own."""
        self._push(client, _messages.GuiUpdateMessage(panel._impl.uuid, {"visible": visible}))
        if width_px is not None:
            self.set_width(client, panel, width_px)

    def set_width(self, client: int, panel: viser.PanelHandle | _gui_handles.MainPanelHandle, width_px: int) -> None:
        """How wide a panel is in one page."""
        gui = self._server.gui
        placed = gui._next_layout_counter(), gui._layout_run_id
        self._push(client, _messages.GuiSetPanelWidthMessage(panel._placement_uuid, width_px, *placed))

    def lay_out(self, client: int, chart: Any, height_px: int, axes: tuple[dict[str, Any], ...]) -> None:
        """How high a chart is in one page, and how its axes are drawn there."""
        self._push(client, _messages.GuiUpdateMessage(chart._impl.uuid, {"height": height_px, "axes": axes}))

    def set_aspect(self, client: int, figure: Any, aspect: float) -> None:
        """How high a Plotly figure is in one page, over its width."""
        self._push(client, _messages.GuiUpdateMessage(figure._impl.uuid, {"aspect": aspect}))

    def pages(self) -> tuple[int, ...]:
        """The pages that are open, by their numbers."""
        return tuple(self._server.get_clients())

    def run(self, source: str, client: int | None = None) -> None:
        """Runs JavaScript in one page, or in every page that is or will be open; texts go into `source` as JSON."""
        message = _messages.RunJavascriptMessage(source=source)
        if client is None:
            self._server.gui._websock_interface.queue_message(message)
        else:
            self._push(client, message)

    def take_transfers(
        self, started: Callable[[int, TransferStart], None], came: Callable[[int, TransferPart], None]
    ) -> None:
        """Answers uploads in viser's place: with the page that sends, on the server's thread."""
        interface = self._server.gui._websock_interface
        for message in (TransferStart, TransferPart):
            interface.unregister_handler(message)
        interface.register_handler(TransferStart, started)
        interface.register_handler(TransferPart, came)

    def acknowledge(self, client: int, source: str | None, uuid: str, written: int, total: int) -> None:
        """Tells the page that uploads, and it alone, how much of a transfer is here; `source` is its button."""
        self._send(
            client,
            _messages.FileTransferPartAck(
                source_component_uuid=source, transfer_uuid=uuid, transferred_bytes=written, total_bytes=total
            ),
        )

    def take_away(self, client: int, notification: str) -> None:
        """Takes a notification away again."""
        self._send(client, _messages.RemoveNotificationMessage(notification))

    def _send(self, client: int, message: Any) -> None:
        """To one page alone: what all are sent is repeated to every page that opens later."""
        handle = self._server.get_clients().get(client)
        if handle is not None:
            handle._websock_connection.queue_message(message)

    def _push(self, client: int, message: Any) -> None:
        state = self._server._websock_server._client_state_from_id.get(client)
        if state is not None:
            state.message_buffer.push(message)

    def _guis(self, client: int | None) -> list[Any]:
        page = self._server.get_clients().get(client) if client is not None else None
        return [self._server.gui] + ([page.gui] if page else [])
