"""A user's effect as the entries of a table: of an actuator file, or of a command line's `--effect`.

    [effects.user_torque]                     [effects.torque_curve]
    expression = "c*omega + A*sin(7*theta)"   variable = "theta"    # or omega, user, q, load, t
    c = -1e-4                                 modulator = "1"       # or sign_speed, current
    A = { value = 0.02, sigma = 0.005 }       low = 0.0
                                              high = 6.283185307179586
                                              values = [0.01, { value = 0.02, sigma = 0.005 }]

Several of a kind are told apart by an ending: [effects.user_torque_2].
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from ema_model.effects.user.curve import OF_VARIABLE, torque_curve
from ema_model.effects.user.expression import VARIABLES, parse
from ema_model.effects.user.torque import RANGE, user_torque
from ema_model.effects.user.user_effect import UserEffect
from ema_model.errors import InputError, quoted
from ema_model.quantities import as_number

_OF = ", ".join(f"{name} ({meaning})" for name, meaning in VARIABLES.items())
# The keys of each kind, with what they mean.
KEYS = {
    "user_torque": {
        "expression": f'a torque at the motor, N·m, of {_OF}: "c*omega + A*sin(7*theta)"',
        "PARAMETER": "a value for each other name in the expression; in its table, low and high bound it",
    },
    "torque_curve": {
        "variable": f"one of {', '.join(OF_VARIABLE.values())}: what the torque depends on",
        "modulator": "1, sign_speed or current: what the curve is multiplied by; 1 without it",
        "low": "where the first knot stands, in the variable's unit",
        "high": "where the last one stands; over a whole turn of theta, where the first comes again",
        "values": "N·m at 2 to 24 knots at even distances; each a number, or a table with its tolerance",
    },
}
TITLES = {"user_torque": "Your own torque, as an expression", "torque_curve": "Your own torque, as a curve"}
KINDS = tuple(KEYS)
_NAME = re.compile(rf"({'|'.join(KINDS)})(_[A-Za-z0-9_]+)?")
_CURVE = tuple(KEYS["torque_curve"])


def kind_of(name: str) -> str | None:
    """The kind of user's effect that a table of this name holds; None for any other name."""
    found = _NAME.fullmatch(name)
    return found.group(1) if found else None


def read_entries(kind: str, entries: Mapping[str, Any]) -> tuple[UserEffect, dict[str, Any]]:
    """The effect, registered, and the entries of its parameters: a number, or a table with a value, each.

    Raises InputError for an entry that is missing, unknown or no such thing; the numbers themselves are left to the
    reader of the file.
    """
    return _torque(entries) if kind == "user_torque" else _curve(entries)


def parameter_ranges(effect: UserEffect) -> dict[str, tuple[float, float]]:
    """The ranges that the user has set, by parameter: they stand in the file beside its value."""
    return {p.name: (p.low, p.high) for p in effect.parameters if (p.low, p.high) != RANGE}


def _torque(entries: Mapping[str, Any]) -> tuple[UserEffect, dict[str, Any]]:
    text = entries.get("expression")
    if not isinstance(text, str):
        raise InputError('needs expression = "…", a torque in N·m such as "c*omega + A*sin(7*theta)"')
    try:
        known = parse(text).parameters
    except InputError as error:
        raise InputError(f"expression: {error}") from None
    given: dict[str, Any] = {name: entry for name, entry in entries.items() if name != "expression"}
    ranges = {}
    for name, entry in given.items():
        if name not in known:
            raise InputError(f"has no {quoted(name)!r}; its expression has {', '.join(known) or 'no parameters'}")
        if isinstance(entry, dict):
            given[name] = {key: part for key, part in entry.items() if key not in ("low", "high")}
            ranges[name] = (_number("low", entry.get("low", RANGE[0])), _number("high", entry.get("high", RANGE[1])))
    for name in known:
        if name not in given:
            raise InputError(f"lacks {name}, a parameter of its expression; give it a value")
    return user_torque(text, ranges), given


def _curve(entries: Mapping[str, Any]) -> tuple[UserEffect, dict[str, Any]]:
    for name in entries:
        if name not in _CURVE:
            raise InputError(f"has no {quoted(name)!r}; it has {', '.join(_CURVE)}")
    for name in _CURVE:
        if name not in entries and name != "modulator":
            raise InputError(f"lacks {name}; it has {', '.join(_CURVE)}")
    values = entries["values"]
    if not isinstance(values, list):
        raise InputError("values must be a list of numbers, one for each knot of the curve")
    numbers = [entry.get("value") if isinstance(entry, dict) else entry for entry in values]
    effect = torque_curve(
        [_number(f"value {j} of the curve", one) for j, one in enumerate(numbers)],
        _number("low", entries["low"]),
        _number("high", entries["high"]),
        str(entries["variable"]),
        str(entries.get("modulator", "1")),
    )
    return effect, {parameter.name: entry for parameter, entry in zip(effect.parameters, values)}


def _number(name: str, value: Any) -> float:
    if not math.isfinite(as_number(value)):
        raise InputError(f"{name} must be a number, not {quoted(value, 40)!r}")
    return float(value)
