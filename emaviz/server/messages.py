"""Everything that viser's page says to its server, and nothing else: names, types and sizes of each message.

Read in viser 1.1.1's client and in the handlers of its server.  A message that is not one of these, or has
another field or type, or a number that is not finite, is left out whole; the others are looked at again by `gate`.
Not here, so never let through: ShareUrlRequest and ShareUrlDisconnect (a public tunnel), and every message that
only a server sends.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

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


# --- files ------------------------------------------------------------------------------------------------------------


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
