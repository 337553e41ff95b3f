"""Messages of browsers, checked."""

from __future__ import annotations

import math
from collections.abc import Callable
from numbers import Integral
from typing import Annotated, Any, Literal

import msgspec
import viser
from msgspec import Meta

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
