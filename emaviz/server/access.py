"""Who may ask for the page and what may be said: messages of browsers, checked, and what is said of those refused."""

from __future__ import annotations

import asyncio
import hmac
import json
import logging
import math
import re
import secrets
import sys
import threading
import time
from collections.abc import Awaitable, Callable, Sequence
from ipaddress import ip_address
from numbers import Integral
from typing import Annotated, Any, Literal
from urllib.parse import parse_qs

import msgspec
import viser
from msgspec import Meta
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed

from ema_model.errors import InputError
from ema_model.files.opened import shown
from emaviz.server.viser_private import Inside, id_of
from emaviz.text.verdicts import begun

# --- an error beside its field: a line below the control, in the page, until the control is changed again -------------

_SAY = r"""
((id, text, calm) => {
  const field = document.getElementById(id);
  if (!field) return;
  const button = field.tagName === 'BUTTON';
  const home = button ? field.parentElement : (field.closest('.mantine-Flex-root') ?? field).parentElement;
  let line = home.querySelector(':scope > .emaviz-beside');
  if (!text) { line?.remove(); return; }
  if (!line) {
    line = document.createElement('div');
    line.className = 'emaviz-beside';
    line.setAttribute('role', 'alert');
    line.style.cssText = 'font-size:12px;line-height:1.35;padding:2px 2px 0;overflow-wrap:anywhere';
    home.append(line);
    home.addEventListener(button ? 'click' : 'input', () => line.remove(), { once: true });
  }
  line.style.color = calm ? 'var(--mantine-color-dimmed)' : 'light-dark(#e03131,#ff8787)';
  line.textContent = text;
  if (!calm && document.hasFocus()) line.scrollIntoView({ block: 'nearest' });
})(ID, TEXT, CALM)
"""


def say_beside(inside: Inside, control: Any, text: str, client: int | None = None, *, calm: bool = False) -> None:
    """Says it in one page, or in all that are open; no text takes it away.  calm: it is no error."""
    source = _SAY.replace(
        "(ID, TEXT, CALM)", f"({json.dumps(id_of(control))}, {json.dumps(begun(text))}, {json.dumps(calm)})"
    )
    for one in inside.pages() if client is None else (client,):
        inside.run(source, one)


# --- whether a value that a page sends may become the value of a control ----------------------------------------------
# viser stores what it is sent: a number it cannot pack again ends every connection, for good.

_Bounds = Callable[[int], tuple[float | None, float | None]]
LONGEST_TEXT = 10_000  # characters; a challenge's story is the longest that anybody writes


class Refused(ValueError):
    """Says what the control takes.

    may_go_on: the user may be on the way to a value that it takes, as with the first digit of 100 where 4 is the least.
    """

    def __init__(self, reason: str, may_go_on: bool = False) -> None:
        super().__init__(reason)
        self.may_go_on = may_go_on


def checked(control: Any, value: Any) -> Any:
    """The value in the control's own type and within its bounds; Refused if it takes no such value.

    What rounding to the digits that a page shows carried past a bound becomes the bound.
    """
    match control:
        case viser.GuiButtonHandle() if value is True:
            return True
        case viser.GuiCheckboxHandle() if isinstance(value, bool):
            return value
        case viser.GuiDropdownHandle() | viser.GuiButtonGroupHandle():
            if isinstance(value, str) and value in control.options:
                return value
        case viser.GuiTextHandle() if isinstance(value, str):
            if len(value) > LONGEST_TEXT:
                raise Refused(f"a text has at most {LONGEST_TEXT} characters, not {len(value)}", may_go_on=True)
            return value
        case viser.GuiNumberHandle() | viser.GuiSliderHandle():
            return _number(value, type(control.value), control.min, control.max, control.precision)
        case viser.GuiMultiSliderHandle():
            values = _several(control, value, lambda i: (control.min, control.max), control.precision)
            if list(values) != sorted(values):
                raise Refused("the ends are in the wrong order")
            return values
        case viser.GuiVector2Handle() | viser.GuiVector3Handle():
            low, high = (control.min or (None,) * 3), (control.max or (None,) * 3)
            return _several(control, value, lambda i: (low[i], high[i]), control.precision)
        case viser.GuiRgbHandle() | viser.GuiRgbaHandle():
            return _several(control, value, lambda i: (0, 255), 0)
    raise Refused("it takes no such value")  # neither does what shows, and what takes files


def _several(control: Any, value: Any, bounds: _Bounds, precision: int) -> tuple[int | float, ...]:
    if not isinstance(value, (list, tuple)) or len(value) != len(control.value):
        raise Refused(f"it takes {len(control.value)} numbers")
    return tuple(
        _number(one, type(old), *bounds(i), precision) for i, (one, old) in enumerate(zip(value, control.value))
    )


def _number(value: Any, kind: type, low: float | None, high: float | None, precision: int) -> int | float:
    if type(value) not in (int, float) or not abs(value) < math.inf:
        raise Refused("it takes a number")
    whole = bool(issubclass(kind, Integral))  # numpy's too
    if whole:
        if value != int(value):
            raise Refused("it takes a whole number", may_go_on=True)
        value, rounding = int(value), 0.0
        low = -MOST_INT if low is None else max(low, -MOST_INT)
        high = MOST_INT if high is None else min(high, MOST_INT)
    else:
        rounding = 0.500001 * 10.0**-precision
    if low is not None and value < low - rounding:
        raise Refused(f"{_plain(value)} is below {_plain(low)}", may_go_on=True)
    if high is not None and value > high + rounding:
        raise Refused(f"{_plain(value)} is above {_plain(high)}", may_go_on=True)
    if low is not None:
        value = max(value, low)
    return kind(value if high is None else min(value, high))


def _plain(number: float) -> str:
    return str(int(number)) if abs(number) <= MOST_INT and number == int(number) else f"{float(number):g}"


# --- everything that viser's page says to its server, and nothing else ------------------------------------------------
# Everything that viser's page says to its server, and nothing else: names, types and sizes of each message.
#
# Read in viser 1.1.1's client and in the handlers of its server. A message that is not one of these, or has another
# field or type, or a number that is not finite, is left out whole; the others are looked at again by `gate`. Not
# here, so never let through: ShareUrlRequest and ShareUrlDisconnect (a public tunnel), and every message that only a
# server sends.

MOST_INT = 2**53 - 1  # up to which a browser's numbers are exact
LARGEST_FRAME = 1 << 20  # bytes; the page sends files in parts of 512 KiB

_Id = Annotated[str, Meta(max_length=200)]
_Name = Annotated[str, Meta(max_length=1000)]
_Text = Annotated[str, Meta(max_length=100_000)]
_Count = Annotated[int, Meta(ge=0, le=MOST_INT)]
_Number = Annotated[float, Meta(ge=-1e9, le=1e9)]  # NaN is refused with what is too large
_Pixels = Annotated[float, Meta(ge=0, le=65_536)]
_Angle = Annotated[float, Meta(ge=0, le=6.3)]
_Pair = tuple[_Number, _Number]
_Vector = tuple[_Number, _Number, _Number]
_Quaternion = tuple[_Number, _Number, _Number, _Number]
_Index = _Count | None


class Message(msgspec.Struct, tag_field="type", tag=True, forbid_unknown_fields=True):
    """Its class's name is viser's."""


# --- controls ---------------------------------------------------------------------------------------------------------


class Updates(msgspec.Struct, forbid_unknown_fields=True):
    """The one property that a page may change."""

    value: Any


class GuiUpdateMessage(Message):
    """A control was moved: its value is checked against the control."""

    uuid: _Id
    updates: Updates


class GuiButtonHoldMessage(Message):
    """A button is held down: of a button that can be pressed."""

    uuid: _Id
    frequency: _Number


class GuiFormSubmitMessage(Message):
    """Of a form that exists."""

    uuid: _Id


class GuiFormDirtyMessage(Message):
    """Of a form that exists: viser repeats it to every page."""

    uuid: _Id


class CommandTriggerMessage(Message):
    """viser looks whether there is such a command, and whether it is enabled."""

    uuid: _Id


# --- files of users: opened, limited, taken apart safely, written whole, locked ---------------------------------------


class FileTransferStartUpload(Message):
    """Of an upload button that can be pressed; `emaviz.server.uploads` limits the sizes, and says so to the user."""

    source_component_uuid: _Id
    transfer_uuid: _Id
    filename: _Name
    mime_type: _Name
    part_count: _Count
    size_bytes: _Count


class FileTransferPart(Message):
    """One of an unknown transfer, of another client's, or out of turn is ignored by `emaviz.server.uploads`."""

    source_component_uuid: _Id | None
    transfer_uuid: _Id
    part_index: _Count
    content: bytes


# --- answers to what the server asked this page: without the question nobody listens ----------------------------------


class LocalStorageGetItemResponseMessage(Message):
    """What the browser keeps under a key."""

    value: _Text | None
    error: _Text | None
    request_uuid: _Id


class GetRenderResponseMessage(Message):
    """A picture of the scene."""

    payload: bytes
    render_uuid: _Id


# --- the scene --------------------------------------------------------------------------------------------------------


class ViewerCameraMessage(Message):
    """Where this page looks from; concerns this page alone."""

    wxyz: _Quaternion
    position: _Vector
    fov: _Angle
    near: _Number
    far: _Number
    image_height: _Pixels
    image_width: _Pixels
    look_at: _Vector
    up_direction: _Vector


class ScenePointerMessage(Message):
    """A click beside everything, or a rectangle; viser has nobody to tell unless the app asked for it."""

    event_type: Literal["click", "rect-select"]
    ray_origin: _Vector | None
    ray_direction: _Vector | None
    screen_pos: tuple[_Pair, ...]
    modifier: _Id | None


class SceneNodeClickMessage(Message):
    """Of a node that exists."""

    name: _Name
    instance_index: _Index
    ray_origin: _Vector
    ray_direction: _Vector
    screen_pos: _Pair
    modifier: _Id | None
    owner: _Id = ""


class SceneNodeDragMessage(Message):
    """Of a node that exists."""

    phase: Literal["start", "update", "end"]
    name: _Name
    instance_index: _Index
    start_position: _Vector
    start_screen_pos: _Pair
    end_position: _Vector
    end_screen_pos: _Pair
    button: Literal["left", "middle", "right"]
    modifier: _Id | None
    owner: _Id = ""


class TransformControlsUpdateMessage(Message):
    """Of a node that exists: viser repeats the place to every page."""

    name: _Name
    wxyz: _Quaternion
    position: _Vector
    owner: _Id = ""


class TransformControlsDragStartMessage(Message):
    """Of a node that exists."""

    name: _Name
    owner: _Id = ""


class TransformControlsDragEndMessage(Message):
    """Of a node that exists."""

    name: _Name
    owner: _Id = ""


_decode = msgspec.msgpack.Decoder(
    GuiUpdateMessage
    | GuiButtonHoldMessage
    | GuiFormSubmitMessage
    | GuiFormDirtyMessage
    | CommandTriggerMessage
    | FileTransferStartUpload
    | FileTransferPart
    | LocalStorageGetItemResponseMessage
    | GetRenderResponseMessage
    | ViewerCameraMessage
    | ScenePointerMessage
    | SceneNodeClickMessage
    | SceneNodeDragMessage
    | TransformControlsUpdateMessage
    | TransformControlsDragStartMessage
    | TransformControlsDragEndMessage
).decode


def read(frame: str | bytes) -> Message:
    """The message in a frame; ValueError says what is wrong with it."""
    if isinstance(frame, str):
        raise ValueError("text where bytes were expected")
    try:
        message = _decode(frame)
    except (msgspec.MsgspecError, RecursionError) as error:
        raise ValueError(str(error)) from None
    if isinstance(message, ScenePointerMessage):
        click = message.event_type == "click"
        no_ray = message.ray_origin is None or message.ray_direction is None
        if len(message.screen_pos) != (1 if click else 2) or (click and no_ray):
            raise ValueError("a click without its place")
    return message


def write(message: Message) -> bytes:
    """The frame that says this and nothing else."""
    return msgspec.msgpack.encode(message)


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
    SceneNodeClickMessage,
    SceneNodeDragMessage,
    TransformControlsUpdateMessage,
    TransformControlsDragStartMessage,
    TransformControlsDragEndMessage,
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
                message = read(frame)
            except ValueError as error:
                self._complain(f"a message that no page sends was left out: {error}")
                continue
            if self._may_pass(message):
                return write(message)

    def _may_pass(self, message: Message) -> bool:
        client = self._inside.client(self._connection)
        match message:
            case GuiUpdateMessage():
                return self._may_change(client, message)
            case GuiButtonHoldMessage(uuid=uuid):
                return self._inside.lets_at(self._inside.control(client, uuid))
            case FileTransferStartUpload(source_component_uuid=uuid):
                control = self._inside.control(client, uuid)
                return isinstance(control, viser.GuiUploadButtonHandle) and self._inside.lets_at(control)
            case GuiFormSubmitMessage(uuid=uuid) | GuiFormDirtyMessage(uuid=uuid):
                return self._inside.has_form(client, uuid)
        return not isinstance(message, _OF_NODES) or self._inside.has_node(client, message.name)

    def _may_change(self, client: int | None, message: GuiUpdateMessage) -> bool:
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
