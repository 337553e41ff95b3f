"""Whether a value that a page sends may become the value of a control.

viser stores what it is sent: a number it cannot pack again ends every connection, for good.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from numbers import Integral
from typing import Any

import viser

from emaviz.server.messages import MOST_INT

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
