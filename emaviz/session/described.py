"""Settings described where they stand: what a value is called, its unit, and what it may be; checked here alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import cache
from typing import Any, TypeVar, get_type_hints

import msgspec

from ema_model.errors import InputError, quoted
from ema_model.quantities.axes import ROTARY, Axes
from ema_model.quantities.sides import Side

Kind = TypeVar("Kind")


def setting(
    title: str,
    low: float | None = None,
    high: float | None = None,
    *,
    unit: str = "",
    side: Side | None = None,
    one_of: Iterable[str] = (),
    made: Callable[[Any, Axes], Any] | None = None,
) -> msgspec.Meta:
    """For `Annotated[type, setting(…)]` in a Struct.

    title: in a sentence; unit: on a rotary axis; one_of: all that it may be; made(value, axes): what the value becomes,
    where a type and a range do not say it, InputError for a bad one.
    """
    said = {"unit": unit, "side": side, "one_of": tuple(one_of), "made": made}
    return msgspec.Meta(title=title, ge=low, le=high, extra=said)


def checked(kind: type[msgspec.Struct], name: str, value: Any, axes: Axes = ROTARY) -> Any:
    """A value for the setting of that name as its type has it; one line of InputError says why not."""
    of = _types(kind)[name]
    about: msgspec.Meta = of.__metadata__[0]
    said = about.extra or {}
    if said["made"] is not None:
        return said["made"](value, axes)
    if said["one_of"] and value not in said["one_of"]:
        raise InputError(f"{about.title} must be one of {', '.join(said['one_of'])}, not {quoted(value, 40)!r}")
    try:
        read = msgspec.convert(value, of, strict=False)
    except msgspec.ValidationError:
        read = math.nan
    if isinstance(read, float) and not math.isfinite(read):
        raise InputError(f"{about.title} must {_may(of, axes)}, not {_as_given(value)}")
    return read


def title(kind: type[msgspec.Struct], name: str) -> str:
    """What a setting is called in a sentence."""
    return str(_types(kind)[name].__metadata__[0].title)


def limits(kind: type[msgspec.Struct], name: str) -> dict[str, Any]:
    """From and to, as a control's `min` and `max`."""
    about: msgspec.Meta = _types(kind)[name].__metadata__[0]
    return {key: edge for key, edge in (("min", about.ge), ("max", about.le)) if edge is not None}


def taken(kind: type[Kind] | Any, saved: Any, part: str) -> Any:
    """What a session's file holds as its description has it; InputError names the part that makes no sense."""
    try:
        return msgspec.convert(saved, kind)
    except msgspec.ValidationError as error:
        raise InputError(f"the session's {part} is damaged ({quoted(error, 120)}); save it anew") from None


def number(value: Any, what: str) -> float:
    """A finite number, or InputError."""
    try:
        read = float(value)
    except (TypeError, ValueError, OverflowError):
        read = math.nan
    if not math.isfinite(read):
        raise InputError(f"{what} must be a number, not {quoted(value, 40)!r}")
    return read


def _may(of: Any, axes: Axes) -> str:
    about, base = of.__metadata__[0], of.__origin__
    if base is str:
        return "be a text"
    if base is int:
        return f"be a whole number from {about.ge} to {about.le}"
    low, high = (f"{edge:g}".replace("-", "−") for edge in (about.ge, about.le))
    unit = axes.unit(about.extra["unit"], about.extra["side"])
    return f"lie between {low} and {high} {unit}".rstrip()


def _as_given(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float | int) and not isinstance(value, bool) else repr(quoted(value, 40))


@cache
def _types(kind: type[msgspec.Struct]) -> dict[str, Any]:
    return get_type_hints(kind, include_extras=True)
