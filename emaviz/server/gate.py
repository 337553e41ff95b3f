"""Lets through, of what a browser says, what this page can mean.

viser checks nothing: not a value's type or bounds, not whether a control is disabled, not a message's form.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import viser
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from emaviz.server import messages
from emaviz.server.beside import say_beside
from emaviz.server.complaints import Complaints
from emaviz.server.values import Refused, checked
from emaviz.server.viser_private import Inside

TYPING_S = 1.5  # without another digit, after which a number is taken as typed
_ORDINARY = (1000, 1001, 1006, 1011)  # ends of a connection: left, going, torn, asleep
_OF_NODES = (
    messages.SceneNodeClickMessage,
    messages.SceneNodeDragMessage,
    messages.TransformControlsUpdateMessage,
    messages.TransformControlsDragStartMessage,
    messages.TransformControlsDragEndMessage,
)


class Gate:
    """Of one connection: stands in for its `recv`."""

    def __init__(self, server: viser.ViserServer, connection: ServerConnection, complain: Complaints) -> None:
        self._server, self._inside, self._connection, self._complain = server, Inside(server), connection, complain
        self._plain: Callable[[], Awaitable[str | bytes]] = connection.recv
        self._waiting: dict[str, asyncio.TimerHandle] = {}  # values that are still being typed, by their control
        self._passed: Any = None  # the control whose new value was let through last

    async def recv(self) -> bytes:
        """The next message that may pass, written anew, so that what is heard is what was checked."""
        if self._passed is not None:  # viser takes it after this, in a task of its own
            asyncio.get_running_loop().call_soon(self._keep_whole, self._passed)
            self._passed = None
        while True:
            try:
                frame = await self._plain()
            except ConnectionClosed as closed:
                self._forget()
                if closed.sent and closed.sent.code not in _ORDINARY and not closed.rcvd_then_sent:
                    self._complain(f"a browser's connection was closed: {closed.sent.reason or closed.sent.code}")
                raise
            try:
                message = messages.read(frame)
            except ValueError as error:
                self._complain(f"a message that no page sends was left out: {error}")
                continue
            if self._may_pass(message):
                return messages.write(message)

    def _may_pass(self, message: messages.Message) -> bool:
        client = self._inside.client(self._connection)
        match message:
            case messages.GuiUpdateMessage():
                return self._may_change(client, message)
            case messages.GuiButtonHoldMessage(uuid=uuid):
                return self._inside.lets_at(self._inside.control(client, uuid))
            case messages.FileTransferStartUpload(source_component_uuid=uuid):
                control = self._inside.control(client, uuid)
                return isinstance(control, viser.GuiUploadButtonHandle) and self._inside.lets_at(control)
            case messages.GuiFormSubmitMessage(uuid=uuid) | messages.GuiFormDirtyMessage(uuid=uuid):
                return self._inside.has_form(client, uuid)
        return not isinstance(message, _OF_NODES) or self._inside.has_node(client, message.name)

    def _may_change(self, client: int | None, message: messages.GuiUpdateMessage) -> bool:
        control = self._inside.control(client, message.uuid)
        if control is None:
            return False
        if (waiting := self._waiting.pop(message.uuid, None)) is not None:
            waiting.cancel()
        if not self._inside.lets_at(control):
            self._inside.send_value(client, control)
            return False
        try:
            message.updates.value = checked(control, message.updates.value)
        except Refused as refused:
            if refused.may_go_on:
                later = asyncio.get_running_loop().call_later
                self._waiting[message.uuid] = later(TYPING_S, self._refuse, client, message.uuid, str(refused))
            else:
                self._inside.send_value(client, control)
            return False
        self._passed = control
        return True

    def _keep_whole(self, control: Any) -> None:
        """A choice that was taken away between the check and viser's taking it becomes the first that there is."""
        if isinstance(control, viser.GuiDropdownHandle) and control.value not in control.options:
            asyncio.get_running_loop().run_in_executor(None, setattr, control, "value", control.options[0])

    def _refuse(self, client: int | None, uuid: str, reason: str) -> None:
        """Nothing more was typed: the field shows what counts, and the user is told why."""
        self._waiting.pop(uuid, None)
        control = self._inside.control(client, uuid)
        if control is None:
            return
        self._inside.send_value(client, control)
        page = self._server.get_clients().get(-1 if client is None else client)
        if page is not None:
            text = f"{control.label}: {reason}; the value before it stays."
            page.add_notification("Value refused", text, auto_close_seconds=8.0, color="red")
            say_beside(self._inside, control, f"{reason}; the value before it stays", page.client_id)

    def _forget(self) -> None:
        for waiting in self._waiting.values():
            waiting.cancel()
        self._waiting.clear()
