"""Effects that the user makes: a torque at the motor's shaft as an expression or as a curve, and its table in files.

    [effects.user_torque]                     [effects.torque_curve]
    expression = "c*omega + A*sin(7*theta)"   variable = "theta"    # or omega, user, q, load, t
    c = -1e-4                                 modulator = "1"       # or sign_speed, current
    A = { value = 0.02, sigma = 0.005 }       low = 0.0
                                              high = 6.283185307179586
                                              values = [0.01, { value = 0.02, sigma = 0.005 }]

Several of a kind are told apart by an ending: [effects.user_torque_2].
"""

from __future__ import annotations

import hashlib
import linecache
import math
import re
import sys
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ema_model import quantities
from ema_model.effects import MOTOR, NEITHER, Effect, Parameter, register
from ema_model.effects.effect import PLACES
from ema_model.effects.user.expression import VARIABLES, Expression, Node, parse
from ema_model.errors import InputError, quoted
from ema_model.quantities import as_number

# --- an effect that a user made, and what is written of it beside its parameters --------------------------------------


@dataclass(frozen=True)
class UserEffect(Effect):
    """An effect that is no file of the catalogue; its table in actuator files is read and written below.

    Its name ends in a hash of its kernels; what differs in its parameters' values alone has the same name.
    """

    kind: str = ""  # "user_torque" or "torque_curve"
    definition: dict[str, str | float] = field(default_factory=dict, hash=False)  # makes its kernels again


# --- a generated effect as a module under a name that tells its source ------------------------------------------------

_FUNCTIONS_SOURCE = Path(__file__).with_name("functions.py").read_text(encoding="utf-8")
_HEAD = """\"\"\"Generated: a user's effect; `ema_model.effects.user.torque` has written it.\"\"\"

import numpy as np

from ema_model.physics.jit import scalar
from ema_model.physics.elementary import clamp, sine
from ema_model.effects.user.functions import (
    cosine,
    exponential,
    hyperbolic_tangent,
    larger,
    limited,
    power,
    sign_of,
    smaller,
    square_root,
)
"""
_importing = threading.Lock()


def generated_module(kind: str, kernels: str, parameters: Sequence[str] = ()) -> tuple[str, ModuleType]:
    """Makes a module of these kernels: the effect's name `kind_<hash>`, and the module.

    A stack is kept under its effects' names, so the hash covers all that makes it: what the kernels inline (with a
    function of `functions.py` changed, it is another effect) and the names of the effect's parameters.
    """
    source = f"{_HEAD}\n\n{kernels}"
    whole = "\0".join([_FUNCTIONS_SOURCE, source, *parameters])
    name = f"{kind}_{hashlib.sha256(whole.encode()).hexdigest()[:12]}"
    with _importing:
        return name, _module(name, source)


@cache
def _module(name: str, source: str) -> ModuleType:
    module = ModuleType(f"ema_model_{name}")
    file = f"<{module.__name__}>"
    linecache.cache[file] = (len(source), None, source.splitlines(keepends=True), file)  # as a stack's composition
    exec(compile(source, file, "exec"), vars(module))
    sys.modules[module.__name__] = module  # a stack's composition imports it by this name
    return module


# --- a torque as the user's own expression ----------------------------------------------------------------------------

RANGE = (-1e3, 1e3)
_OF_EXPRESSION = {"t": "time", "theta": "theta", "omega": "omega", "q": "current", "user": "user"}
_CALLED = {
    "sin": "sine",
    "cos": "cosine",
    "exp": "exponential",
    "sqrt": "square_root",
    "abs": "abs",
    "sign": "sign_of",
    "tanh": "hyperbolic_tangent",
    "min": "smaller",
    "max": "larger",
    "clamp": "limited",
    "**": "power",
}


def user_torque(text: str, ranges: Mapping[str, tuple[float, float]] | None = None) -> UserEffect:
    """The effect of a torque in N·m, added at the shaft; it is registered, so that models find it by its name.

    text: see `parse`; its parameters are 1 by default (or the nearest to it) in `ranges`, else −1000 … 1000.
    t counts from the recording's start.
    The same expression given again takes the place of the one before.
    Raises InputError for a text that is no expression, and for ranges of no parameter or without width.
    """
    expression = parse(text)
    ranges = dict(ranges or {})
    for name, (low, high) in ranges.items():
        if name not in expression.parameters:
            known = ", ".join(expression.parameters) or "none"
            raise InputError(f"the expression has no parameter {quoted(name)!r}; it has {known}")
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise InputError(f"the range of {name} must go from a number to a larger one, not from {low} to {high}")
    name, module = generated_module("user_torque", kernels(expression), expression.parameters)
    return register(
        UserEffect(
            title="User's torque",
            equation=f"T = {expression.text}",
            source="the user's own expression",
            explanation=(
                "A torque in N·m that acts at the motor's shaft, written by the user in terms of "
                + "; ".join(f"{variable}: {meaning}" for variable, meaning in VARIABLES.items())
                + ". Its parameters are fitted like those of any effect. Where it has no value, as in a division by "
                "zero, the run counts as failed."
            ),
            parameters=tuple(_parameter(one, ranges.get(one, RANGE)) for one in expression.parameters),
            severities=(0.5, 1.0, 2.0),
            places=(module.shaft_torque, module.user_position),
            shows="as the expression says",
            mistaken_for="",
            family="mechanics",
            name=name,
            kind="user_torque",
            definition={"expression": expression.text},
        )
    )


def _parameter(name: str, limits: tuple[float, float]) -> Parameter:
    low, high = (float(limit) for limit in limits)
    return Parameter(name, "in the user's expression", min(max(1.0, low), high), low, high, side=NEITHER)


def kernels(expression: Expression) -> str:
    """Source of the effect's functions, made from the checked nodes alone; a torque without value fails the run."""
    own = [f"p{index}" for index in range(len(expression.parameters))]
    lines: list[str] = []
    value = _emit(expression.root, lines, {})
    source = [
        "@scalar",
        f"def shaft_torque({', '.join([*PLACES['shaft_torque'], *own])}):",
        *lines,
        # An infinite torque becomes NaN here: an end stop would hold the rotor and hide it.
        f"    return torque + ({value} + 0.0 * {value})",
        "",
        "",
        "@scalar",
        f"def user_position({', '.join([*PLACES['user_position'], *own])}):",
        # The play and the clamps of a controlled drive would hold back a NaN of the angle, and the current look sound.
        "    return user + 0.0 * theta",
    ]
    return "\n".join([*source, ""])


def _emit(node: Node, lines: list[str], known: dict[Node, str]) -> str:
    """Appends the lines that compute a node, one operation each, and returns its name; what repeats stands once."""
    if node in known:
        return known[node]
    if node.kind == "variable":
        return _OF_EXPRESSION[node.name]
    if node.kind == "parameter":
        return f"p{int(node.value)}"
    operands = [_emit(operand, lines, known) for operand in node.operands]
    match node.kind:
        case "number":
            text = repr(node.value)
        case "negative":
            text = f"-{operands[0]}"
        case "power":
            text = f"{operands[0]} ** {abs(int(node.value))}"
            if node.value < 0.0:  # numba's own negative powers of 0 raise, and would end the runs of all lanes
                text = f"1.0 / ({text})"
        case "+" | "-" | "*" | "/":
            text = f" {node.kind} ".join(operands)
        case kind:
            text = f"{_CALLED[kind]}({', '.join(operands)})"
    known[node] = f"v{len(known)}"
    lines.append(f"    {known[node]} = {text}")
    return known[node]


# --- a torque as a table over one variable, straight between its knots ------------------------------------------------

MOST_KNOTS = 24
_OF_CURVE = {"theta": "theta", "omega": "omega", "user": "user", "q": "current", "load": "load", "t": "time"}
OF_VARIABLE = {
    "motor_angle": "theta",
    "motor_speed": "omega",
    "user_position": "user",
    "current": "q",
    "load": "load",
    "time": "t",
}
_UNITS = {name: quantities.VARIABLES[variable].unit for variable, name in OF_VARIABLE.items()}
_SYMBOLS = {"theta": "θ", "omega": "ω", "user": "θ_user", "q": "q", "load": "T_load", "t": "t"}
_FACTORS = {"1": "", "sign_speed": " * sign_of(omega)", "current": " * current"}
_SHOWN = {"1": "", "sign_speed": " sgn ω", "current": " q"}


def torque_curve(
    values: ArrayLike, low: float, high: float, variable: str = "theta", modulator: str = "1"
) -> UserEffect:
    """The effect of a torque that follows a curve; it is registered, so that models find it by its name.

    values: (2 … 24,) N·m (N·m/A with the modulator "current"), at even distances from low to high in the variable's
    unit; they are the parameters' defaults.  Beyond the ends the curve stays level.  Only a curve over theta whose
    span is a turn or a whole fraction of it repeats: its last knot lies one distance before `high`, where the first
    comes again.  A curve on the same knots takes the place of the one before.
    Raises InputError for wrong knots, limits, variables and modulators.
    """
    knots = _knots(values)
    if variable not in _OF_CURVE:
        raise InputError(f"no variable {quoted(variable)!r} for a torque curve; variables are {', '.join(_OF_CURVE)}")
    if modulator not in _FACTORS:
        raise InputError(f"no modulator {quoted(modulator)!r} for a torque curve; modulators are {', '.join(_FACTORS)}")
    if not (math.isfinite(low) and math.isfinite(high) and high - low > 1e-12 * max(abs(low), abs(high))):
        raise InputError(f"a torque curve must go from a number to a larger one, not from {low} to {high}")
    low, high = float(low), float(high)
    periodic = variable == "theta" and is_period(high - low)
    name, module = generated_module("torque_curve", kernel(len(knots), low, high, variable, modulator, periodic))
    distance = (high - low) / (len(knots) if periodic else len(knots) - 1)
    unit = "N·m/A" if modulator == "current" else "N·m"
    symbol = _SYMBOLS[variable]
    return register(
        UserEffect(
            title="Torque curve",
            equation=f"T = f({symbol}){_SHOWN[modulator]}, {symbol} = {low:g} … {high:g} {_UNITS[variable]}",
            source="a curve measured by the residual",
            explanation=(
                "A torque that no effect of the library explains, as a table: straight lines between knots at even "
                "distances. Its knots are fitted like the parameters of any effect."
            ),
            parameters=tuple(
                Parameter(
                    f"knot_{j:02d}",
                    f"{unit} at {symbol} = {low + j * distance:.4g} {_UNITS[variable]}",
                    value,
                    *RANGE,
                    side=MOTOR,
                    unit=unit,
                )
                for j, value in enumerate(knots)
            ),
            severities=(0.5 * knots[0], knots[0], 2.0 * knots[0]),
            places=(module.shaft_torque,),
            shows=f"against {symbol}",
            mistaken_for="",
            family="mechanics",
            name=name,
            kind="torque_curve",
            definition={"variable": variable, "modulator": modulator, "low": low, "high": high},
        )
    )


def is_period(span: float) -> bool:
    """Whether a span, rad, is a turn or a whole fraction of it."""
    parts = 2.0 * math.pi / span
    return parts > 0.5 and abs(parts - round(parts)) < 1e-6 * parts


def _knots(values: ArrayLike) -> list[float]:
    try:
        knots = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise InputError("the knots of a torque curve must be numbers") from None
    if knots.ndim != 1 or not 2 <= knots.size <= MOST_KNOTS:
        raise InputError(f"a torque curve needs a row of 2 to {MOST_KNOTS} knots, not shape {knots.shape}")
    for j, value in enumerate(knots):
        if not RANGE[0] <= value <= RANGE[1]:
            raise InputError(f"knot {j} of the torque curve is {value:g}; it must lie in {RANGE[0]:g} … {RANGE[1]:g}")
    return knots.tolist()


def kernel(count: int, low: float, high: float, variable: str, modulator: str, periodic: bool) -> str:
    """Source of the effect's function: a sum of hats, one over each knot, without a branch or an index."""
    own = [f"k{j}" for j in range(count)]
    scale = (count if periodic else count - 1) / (high - low)
    lines = [f"    x = ({_OF_CURVE[variable]} - {low!r}) * {scale!r}"]
    hats = [(float(j), knot) for j, knot in enumerate(own)]
    if periodic:
        lines.append(f"    x = x - {float(count)!r} * np.floor(x * {1.0 / count!r})")
        hats.append((float(count), own[0]))
    else:
        lines.append(f"    x = clamp(x, 0.0, {float(count - 1)!r})")
    lines.append("    value = 0.0")
    lines += [f"    value += {knot} * clamp(1.0 - abs(x - {at!r}), 0.0, 1.0)" for at, knot in hats]
    return "\n".join(
        [
            "@scalar",
            f"def shaft_torque({', '.join([*PLACES['shaft_torque'], *own])}):",
            *lines,
            f"    return torque + value{_FACTORS[modulator]}",
            "",
        ]
    )


# --- a user's effect as the entries of a table: of an actuator file, or of a command line's `--effect` ----------------

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
