"""Who may ask for the page, and what is said of those who may not."""

from __future__ import annotations

import asyncio
import hmac
import logging
import re
import secrets
import sys
import threading
import time
from collections.abc import Awaitable, Callable, Sequence
from ipaddress import ip_address
from typing import Any
from urllib.parse import parse_qs

import viser
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed

from ema_model.errors import InputError
from ema_model.files.opened import shown
from emaviz.server import messages
from emaviz.server.field_error import say_beside
from emaviz.server.messages import Refused, checked
from emaviz.server.viser_private import Inside

# --- what nobody honest sends costs one line on stderr, and a flood of it a few lines a minute ------------------------

_LINES = 10  # of one period; what comes beyond is counted
_PERIOD_S = 60.0
_LENGTH = 300  # characters


class Complaints(logging.Handler):
    """Says a line on stderr, as a function and as the handler of a library's log."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._counting = threading.Lock()
        self._began, self._said, self._unsaid = 0.0, 0, 0

    def __call__(self, text: object) -> None:
        """One line, whatever `text` holds; nothing when this period's lines are used up."""
        with self._counting:
            now = time.monotonic()
            if now - self._began > _PERIOD_S:
                self._began, self._said = now, 0
            if self._said == _LINES:
                self._unsaid += 1
                return
            self._said += 1
            more, self._unsaid = self._unsaid, 0
        tail = f" (and {more} more before it)" if more else ""
        print(f"emaviz: {shown(text, _LENGTH)}{tail}", file=sys.stderr, flush=True)

    def emit(self, record: logging.LogRecord) -> None:
        """A record without its traceback."""
        error = record.exc_info[1] if record.exc_info else None
        if isinstance(error, RuntimeError) and "after shutdown" in str(error):
            return  # a browser that was still there when the app ended
        self(record.getMessage() + (f": {error or type(error).__name__}" if error is not None else ""))

    def log(self) -> logging.Logger:
        """A log of its own, all of whose warnings and errors come here."""
        logger = logging.Logger("emaviz.server", logging.WARNING)
        logger.addHandler(self)
        return logger


# --- what the page may do in the browser: speak to its own server, and show the Rerun viewer's page -------------------

# All that viser's client needs is in its own page; blob: and data: are its workers, textures and saved files.
_PAGE = "default-src 'self' 'unsafe-inline' 'unsafe-eval' blob: data:"
_REST = "frame-ancestors 'self'; object-src 'none'; base-uri 'none'; form-action 'none'"


def protect(headers: Headers, host: str, viewer: str | None) -> None:
    """Adds the page's policy to an answer.

    host: name and port by which the browser asked; viewer: the address of the Rerun viewer, if it reaches that.
    """
    # Not every browser takes ws: for 'self', and a policy has no way to write an IPv6 address.
    websocket = "" if host.startswith("[") else f" ws://{host}"
    frame = f" {viewer}" if viewer else ""
    headers["Content-Security-Policy"] = (
        f"{_PAGE}; connect-src 'self' blob: data:{websocket}; frame-src 'self'{frame}; {_REST}"
    )
    headers["X-Content-Type-Options"] = "nosniff"
    headers["Referrer-Policy"] = "no-referrer"


# --- lets through, of what a browser says, what this page can mean ----------------------------------------------------
# viser checks nothing: not a value's type or bounds, not whether a control is disabled, not a message's form.

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


# --- who gets an answer -----------------------------------------------------------------------------------------------
# Who gets an answer: this machine's own page; from a network, who asks by an allowed name and has the token.

_NAME = re.compile(r"[a-z0-9_]([a-z0-9_.-]{0,251}[a-z0-9_])?")
_NETLOC = re.compile(r"(?P<name>\[[0-9a-f:.]+\]|[a-z0-9_-]+(\.[a-z0-9_-]+)*\.?)(:(?P<port>[0-9]{0,5}))?")
_PORTS = {"http": 80, "https": 443}


class Door:
    """Of a server on one address; `token` is None on the loopback, where no other machine can come."""

    def __init__(self, host: str, allow_hosts: Sequence[str] = ()) -> None:
        """allow_hosts: names or addresses, without port, by which other machines ask.  InputError: they do not fit."""
        for name in allow_hosts:
            if not _NAME.fullmatch(_bare(name)) and not _is_address(name):
                raise InputError(f"--allow-host {shown(name)}: give a bare name or address, such as rig.example.org")
        if not is_loopback(host) and not allow_hosts:
            raise InputError(
                f"--host {shown(host)} opens the app to the network: add --allow-host NAME, "
                "the name or address that goes into the browser's address bar"
            )
        self.host = host
        self._everywhere = not host or (_is_address(host) and ip_address(_bare(host)).is_unspecified)
        own = [] if self._everywhere else [host]
        self._names = frozenset(_bare(name) for name in (*own, *allow_hosts))
        self._first = allow_hosts[0] if allow_hosts else host
        self.token = secrets.token_urlsafe(32) if allow_hosts else None

    def address(self, port: int) -> str:
        """Where others find the page."""
        return f"http://{_netloc(self._first, port)}"

    def entry(self, port: int, here: bool = False) -> str:
        """The address to open first, with its token; here: by a browser on this machine."""
        name = self._first
        if here:
            name = self.host if not self._everywhere else "::1" if ":" in self.host else "127.0.0.1"
        return f"http://{_netloc(name, port)}" + (f"/?token={self.token}" if self.token else "")

    def asked(self, headers: Headers) -> str | None:
        """The host and port by which a browser asks, as in an address; None if they are not ours."""
        hosts = headers.get_all("Host")
        found = _split(hosts[0]) if len(hosts) == 1 else None
        if found is None or not (found[0] in self._names or is_loopback(found[0])):
            return None
        return _netloc(*found)

    def asked_here(self, headers: Headers) -> bool:
        """Whether the browser asked by a name of the loopback, so that it reaches what else listens there."""
        host = self.asked(headers)
        return host is not None and is_loopback(host.rpartition(":")[0])

    def refusal(self, path: str, headers: Headers, port: int) -> str | None:
        """Why this request gets no answer, or None; path: with its query, port: of this server."""
        if self.asked(headers) is None:
            return "this server answers to its own address only"
        for origin in headers.get_all("Origin"):
            scheme, _, there = origin.partition("://")
            if scheme not in _PORTS or _split(there, _PORTS[scheme]) != _split(headers["Host"], _PORTS[scheme]):
                return "requests from other pages are refused"
        if self.token and not self.brings_token(path) and not self._has_cookie(headers, port):
            return "open the address that the app printed when it started, with its token"
        return None

    def brings_token(self, path: str) -> bool:
        """Whether the token stands in the address."""
        return any(self._is_token(one) for one in parse_qs(path.partition("?")[2]).get("token", ()))

    def cookie(self, port: int) -> str:
        """What the browser keeps in the token's place; of this port, as cookies are shared among ports."""
        return f"emaviz-{port}={self.token}; HttpOnly; SameSite=Strict; Path=/"

    def _has_cookie(self, headers: Headers, port: int) -> bool:
        pairs = [part.strip().partition("=") for line in headers.get_all("Cookie") for part in line.split(";")]
        return any(name == f"emaviz-{port}" and self._is_token(value) for name, _, value in pairs)

    def _is_token(self, given: str) -> bool:
        return hmac.compare_digest(given.encode("utf-8", "replace"), str(self.token).encode())


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches that name or address."""
    return _bare(host) == "localhost" or (_is_address(host) and ip_address(_bare(host)).is_loopback)


def _bare(name: str) -> str:
    """Without brackets, the root's dot, and capitals."""
    return name.lower().removeprefix("[").removesuffix("]").removesuffix(".")


def _is_address(name: str) -> bool:
    try:
        ip_address(_bare(name))
    except ValueError:
        return False
    return True


def _split(netloc: str, default: int = 80) -> tuple[str, int] | None:
    """Name and port; None if it is no such thing."""
    found = _NETLOC.fullmatch(netloc.lower())
    if found is None:
        return None
    port = int(found["port"] or default)
    return (_bare(found["name"]), port) if port <= 65535 else None


def _netloc(name: str, port: int) -> str:
    name = _bare(name)
    return f"[{name}]:{port}" if ":" in name else f"{name}:{port}"
