"""A torque at the motor's shaft, as the user's own expression."""

from __future__ import annotations

import math
from collections.abc import Mapping

from ema_model.effects import NEITHER, Parameter, register
from ema_model.effects.effect import PLACES
from ema_model.effects.user.expression import VARIABLES, Expression, Node, parse
from ema_model.effects.user.module import generated_module
from ema_model.effects.user.user_effect import UserEffect
from ema_model.errors import InputError, quoted

RANGE = (-1e3, 1e3)
_ARGUMENTS = {"t": "time", "theta": "theta", "omega": "omega", "q": "current", "user": "user"}
_FUNCTIONS = {
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

    text: see `expression.parse`; its parameters are 1 by default (or the nearest to it) in `ranges`, else −1000 … 1000.
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
        return _ARGUMENTS[node.name]
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
            text = f"{_FUNCTIONS[kind]}({', '.join(operands)})"
    known[node] = f"v{len(known)}"
    lines.append(f"    {known[node]} = {text}")
    return known[node]
