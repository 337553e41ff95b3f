"""A user's expression, read into a checked tree; it is never run as Python.

The text is cut into numbers, names and signs first (anything else is refused with its column), then parsed by
`ast`, and each node is translated by a closed list.  What leaves this module are the nodes below, in which only
numbers, known names and the order of parameters are left: no text of the user reaches a compiler.
"""

from __future__ import annotations

import ast
import keyword
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from ema_model.errors import InputError

VARIABLES = {
    "t": "time since the start of the run, s",
    "theta": "motor angle, rad",
    "omega": "motor speed, rad/s",
    "q": "equivalent current, A",
    "user": "user position, rad",
}
CONSTANTS = {"pi": math.pi}
FUNCTIONS = {  # number of arguments
    **dict.fromkeys(("sin", "cos", "exp", "sqrt", "abs", "sign", "tanh"), 1),
    **dict.fromkeys(("min", "max"), 2),
    "clamp": 3,
}
MOST_CHARACTERS = 500
MOST_PARAMETERS = 12
_MOST_NODES = 200
_DEEPEST = 60
_LONGEST_NAME = 32
_TAKEN = ("expression",)  # names of other entries where an expression is written down
_LARGEST_EXPONENT = 16.0

_TOKEN = re.compile(
    r"(?P<space>[ ]+)|(?P<number>(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)"
    r"|(?P<name>[A-Za-z][A-Za-z0-9_]*)|(?P<sign>\*\*|[-+*/(),])"
)
_WRITTEN = {"θ": "theta", "ω": "omega", "π": "pi", "−": "-", "×": "*", "·": "*", "^": "**", "²": "**2", "÷": "/"}
_OPERATORS: dict[type[ast.operator], str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**"}
_KINDS = "numbers, names, + - * / **, parentheses and functions"


@dataclass(frozen=True)
class Node:
    """One step of a checked expression.

    kind: "number" (value), "variable" (name), "parameter" (value: its place in the order), "negative", "+", "-", "*",
    "/", "**", "power" (value: a whole exponent) or a name of `FUNCTIONS`.
    """

    kind: str
    value: float = 0.0
    name: str = ""
    operands: tuple[Node, ...] = ()


@dataclass(frozen=True)
class Expression:
    """A checked expression; every name that is not a variable, a constant or a function is a parameter."""

    text: str
    parameters: tuple[str, ...]  # in the order in which they appear
    variables: tuple[str, ...]  # those of `VARIABLES` that it uses
    root: Node


def parse(text: str) -> Expression:
    """Reads an expression; InputError says in one line the column (from 1), what is wrong and what to write."""
    if not isinstance(text, str):
        raise InputError(f"an expression is a text, not {type(text).__name__}")
    if len(text) > MOST_CHARACTERS:
        raise InputError(f"the expression has {len(text)} characters; use at most {MOST_CHARACTERS}")
    if not text.strip(" "):
        raise InputError("the expression is empty; write a torque in N·m, for example c*omega + A*sin(7*theta)")
    _check_tokens(text)
    start = len(text) - len(text.lstrip(" "))
    try:
        body = ast.parse(text.strip(" "), mode="eval").body
    except SyntaxError as error:
        column = min(start + error.offset, len(text)) if error.offset else len(text.rstrip(" "))  # 0: at its end
        raise _wrong(column, "the expression cannot be read from here; is a sign or a value missing?") from None
    except (RecursionError, MemoryError, ValueError):
        raise InputError("the expression is nested too deeply; use fewer parentheses and signs") from None
    reading = _Reading(start)
    root = reading.node(body, 0)
    return Expression(
        text.strip(" "), tuple(reading.parameters), tuple(v for v in VARIABLES if v in reading.used), root
    )


def _wrong(column: int, message: str) -> InputError:
    return InputError(f"column {column}: {message}")


def _check_tokens(text: str) -> None:
    """Refuses all that is no number, name or sign, and parentheses that do not match."""
    opened: list[int] = []
    at, before = 0, ""
    while at < len(text):
        column = at + 1
        token = _TOKEN.match(text, at)
        if token is None:
            character = text[at]
            known = f"write {_WRITTEN[character]}" if character in _WRITTEN else f"use {_KINDS}"
            raise _wrong(column, f"{character!a} cannot be used; {known}")
        kind, found = token.lastgroup or "", token.group()
        if kind in ("name", "number") and before in ("name", "number"):
            raise _wrong(column, "a sign is missing here, as in 2*theta")
        if kind == "name" and keyword.iskeyword(found):
            raise _wrong(column, f"{found!r} cannot be used; use {_KINDS}")
        if kind == "name" and len(found) > _LONGEST_NAME:
            raise _wrong(column, f"this name has {len(found)} characters; use at most {_LONGEST_NAME}")
        if found == "(":
            opened.append(column)
            if len(opened) > _DEEPEST:
                raise _wrong(column, f"more than {_DEEPEST} parentheses are open; use fewer")
        elif found == ")":
            if not opened:
                raise _wrong(column, "this parenthesis was never opened")
            opened.pop()
        at, before = token.end(), before if kind == "space" else kind
    if opened:
        raise _wrong(opened[-1], "this parenthesis is never closed")


@dataclass
class _Reading:
    """Translates ast's nodes by a closed list, counting them."""

    start: int  # characters left off in front
    parameters: list[str] = field(default_factory=list)
    used: set[str] = field(default_factory=set)
    count: int = 0

    def node(self, given: ast.AST, depth: int) -> Node:
        """The checked node of an ast node."""
        self.count += 1
        if self.count > _MOST_NODES or depth > _DEEPEST:
            raise self._wrong(
                given, f"the expression is too long; use at most {_MOST_NODES} terms, {_DEEPEST} in a row"
            )
        match given:
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                return Node("number", self._number(given, value))
            case ast.Name(id=name):
                return self._name(given, name)
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self.node(operand, depth + 1)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return Node("negative", operands=(self.node(operand, depth + 1),))
            case ast.BinOp(op=ast.Pow(), left=left, right=right):
                return self._power(self.node(left, depth + 1), self.node(right, depth + 1), right)
            case ast.BinOp(op=op, left=left, right=right) if type(op) in _OPERATORS:
                return Node(_OPERATORS[type(op)], operands=(self.node(left, depth + 1), self.node(right, depth + 1)))
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                return self._call(given, name, arguments, depth)
        raise self._wrong(given, f"this cannot be used; use {_KINDS}")

    def _wrong(self, at: ast.AST, message: str) -> InputError:
        return _wrong(self.start + getattr(at, "col_offset", 0) + 1, message)

    def _number(self, at: ast.AST, value: float) -> float:
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self._wrong(at, "this number is too large; use at most 1e308")
        return number

    def _name(self, at: ast.AST, name: str) -> Node:
        if name in VARIABLES:
            self.used.add(name)
            return Node("variable", name=name)
        if name in CONSTANTS:
            return Node("number", CONSTANTS[name])
        if name in FUNCTIONS:
            raise self._wrong(at, f"{name} is a function; write {name}(…)")
        if name in _TAKEN:
            raise self._wrong(at, f"no parameter can be called {name!r}; choose another name")
        if name not in self.parameters:
            if len(self.parameters) == MOST_PARAMETERS:
                raise self._wrong(at, f"{name!r} is one parameter too many; use at most {MOST_PARAMETERS}")
            self.parameters.append(name)
        return Node("parameter", float(self.parameters.index(name)))

    def _call(self, at: ast.AST, name: str, arguments: list[ast.expr], depth: int) -> Node:
        if name not in FUNCTIONS:
            raise self._wrong(at, f"unknown function {name!r}; functions are {', '.join(FUNCTIONS)}")
        if len(arguments) != FUNCTIONS[name]:
            wanted = f"{FUNCTIONS[name]} argument{'s' if FUNCTIONS[name] > 1 else ''}"
            raise self._wrong(at, f"{name} takes {wanted}, not {len(arguments)}")
        return Node(name, operands=tuple(self.node(argument, depth + 1) for argument in arguments))

    def _power(self, base: Node, exponent: Node, at: ast.AST) -> Node:
        """Whole and half exponents become products and a root, which are exact and fast; others stay general."""
        constant = _constant(exponent)
        if constant is None:
            return Node("**", operands=(base, exponent))
        if not abs(constant) <= _LARGEST_EXPONENT:
            raise self._wrong(at, f"the exponent must lie between -{_LARGEST_EXPONENT:g} and {_LARGEST_EXPONENT:g}")
        if constant == round(constant):
            return Node("power", constant, operands=(base,))
        if 2.0 * constant == round(2.0 * constant):
            return Node("power", 2.0 * constant, operands=(Node("sqrt", operands=(base,)),))
        return Node("**", operands=(base, Node("number", constant)))


def _constant(node: Node) -> float | None:
    """The value of a node made of numbers and signs alone, NaN where it has none; None for any other node."""
    if node.kind == "number":
        return node.value
    values = [_constant(operand) for operand in node.operands]
    known = [value for value in values if value is not None]
    if not values or len(known) < len(values):
        return None
    try:
        match node.kind, known:
            case "negative", [x]:
                return -x
            case "+", [x, y]:
                return x + y
            case "-", [x, y]:
                return x - y
            case "*", [x, y]:
                return x * y
            case "/", [x, y]:
                return x / y
            case "**", [x, y]:
                return math.pow(x, y)
            case "power", [x]:
                return math.pow(x, node.value)
    except (ArithmeticError, ValueError):
        return math.nan
    return None


# --- where a fit of an expression begins: values with which each term is as large as the signals suggest --------------
# Every part of an expression has a unit and a usual size: its variables' are measured, the whole is a torque of the
# size that is left. From the whole down to the parameters each has what is then missing: in c·ω it is T/ω, in tanh(ω/v)
# v is as large as ω, in sin(hθ + φ) the phase is 0.

_BASES = ("N·m", "A", "rad", "s")
_ABOVE = {Fraction(1, 2): "^½", Fraction(-1, 2): "^−½"}
_DIGITS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_LEAST = 1e-12


@dataclass(frozen=True)
class Size:
    """A usual size, and the exponents of N·m, A, rad and s in its unit."""

    value: float
    unit: tuple[Fraction, Fraction, Fraction, Fraction] = (Fraction(0), Fraction(0), Fraction(0), Fraction(0))

    def __mul__(self, other: Size) -> Size:
        a, b, c, d = (one + its for one, its in zip(self.unit, other.unit))
        return Size(self.value * other.value, (a, b, c, d))

    def __truediv__(self, other: Size) -> Size:
        return self * other.power(Fraction(-1))

    def power(self, exponent: Fraction) -> Size:
        """It to an exponent."""
        a, b, c, d = (one * exponent for one in self.unit)
        return Size(max(self.value, _LEAST) ** float(exponent), (a, b, c, d))

    @property
    def words(self) -> str:
        """Its unit: 'N·m·s/rad'; '–' for none."""
        above = [_raised(name, one) for name, one in zip(_BASES, self.unit) if one > 0]
        below = [_raised(name, -one) for name, one in zip(_BASES, self.unit) if one < 0]
        under = "·".join(below)
        return (
            "·".join(above or ["1"]) + (f"/{under}" if len(below) == 1 else f"/({under})" if below else "")
            if (above or below)
            else "–"
        )


def _raised(name: str, exponent: Fraction) -> str:
    if exponent == 1:
        return name
    whole = str(exponent.numerator).translate(_DIGITS) if exponent.denominator == 1 else ""
    return f"({name}){whole}" if whole and "·" in name else name + (whole or _ABOVE.get(exponent, f"^({exponent})"))


def _of(*exponents: int) -> tuple[Fraction, Fraction, Fraction, Fraction]:
    a, b, c, d = (Fraction(one) for one in exponents)
    return a, b, c, d


TORQUE, CURRENT, ANGLE, TIME, SPEED = (
    _of(1, 0, 0, 0),
    _of(0, 1, 0, 0),
    _of(0, 0, 1, 0),
    _of(0, 0, 0, 1),
    _of(0, 0, 1, -1),
)
UNITS = {"t": TIME, "theta": ANGLE, "omega": SPEED, "q": CURRENT, "user": ANGLE}  # of the variables
_ONE = Size(1.0)
_RADIAN = Size(1.0, ANGLE)


def beginnings(
    expression: Expression, torque_Nm: float, sizes: Mapping[str, float], order: float = 1.0
) -> dict[str, Size]:
    """A value and a unit for each parameter of an expression.

    torque_Nm: what the whole is to come to; sizes: what its variables usually are, in SI, 1 where it is not said;
    order: how often what is left repeats in a turn of the motor.
    """
    known = {name: Size(abs(sizes.get(name, 1.0)) or 1.0, UNITS[name]) for name in UNITS}
    asking = _Asking(known, order)
    asking.ask(expression.root, Size(max(abs(torque_Nm), _LEAST), TORQUE))
    return {name: asking.found.get(place, _ONE) for place, name in enumerate(expression.parameters)}


class _Asking:
    def __init__(self, variables: Mapping[str, Size], order: float) -> None:
        self._variables, self._order = variables, order
        self.found: dict[int, Size] = {}  # by the parameter's place

    def size(self, node: Node) -> Size | None:
        """Of a part; None where that is still to be said."""
        match node.kind:
            case "number":
                return Size(abs(node.value) or 1.0)
            case "variable":
                return self._variables[node.name]
            case "parameter":
                return self.found.get(int(node.value))
            case "sign" | "sin" | "cos" | "tanh" | "exp":
                return _ONE if self.size(node.operands[0]) is not None else None
        sizes = [self.size(one) for one in node.operands]
        if any(one is None for one in sizes):
            return None
        own = [one for one in sizes if one is not None]
        match node.kind:
            case "*":
                return own[0] * own[1]
            case "/":
                return own[0] / own[1]
            case "power":
                return own[0].power(Fraction(int(node.value)))
            case "**":
                return own[0]
            case "sqrt":
                return own[0].power(Fraction(1, 2))
        return max(own, key=lambda one: one.value)  # of a sum, a difference, limits

    def ask(self, node: Node, whole: Size | None) -> None:
        """Says of a part's parameters what makes it as large as the whole; None: as large as what stands beside."""
        if self.size(node) is not None:
            return
        match node.kind:
            case "parameter":
                self.found[int(node.value)] = whole or _ONE
            case "*":
                self._product(node, whole)
            case "/":
                self._quotient(node.operands[0], node.operands[1], whole)
            case "sin" | "cos":
                self._turns(node.operands[0])
            case "exp" | "tanh":
                self.ask(node.operands[0], _ONE)
            case "sign":
                self.ask(node.operands[0], None)
            case "sqrt":
                self.ask(node.operands[0], None if whole is None else whole.power(Fraction(2)))
            case "power":
                self.ask(node.operands[0], None if whole is None else whole.power(Fraction(1, int(node.value) or 1)))
            case "negative" | "abs":
                self.ask(node.operands[0], whole)
            case "**":
                self.ask(node.operands[0], whole)
                self.ask(node.operands[1], _ONE)
            case _:  # of a sum each part is as large
                if whole is None:
                    whole = next((one for one in map(self.size, node.operands) if one is not None), None)
                for one in node.operands:
                    self.ask(one, whole)

    def _product(self, node: Node, whole: Size | None) -> None:
        """A factor that is a parameter alone makes the rest as large as the whole."""
        factors = _factors(node)
        open_ones = [one for one in factors if self.size(one) is None]
        last = next((one for one in open_ones if one.kind == "parameter"), open_ones[-1])
        for one in open_ones:
            if one is not last:
                self.ask(one, _ONE if one.kind == "parameter" else None)
        beside = _ONE
        for one in factors:
            if one is not last:
                beside = beside * (self.size(one) or _ONE)
        self.ask(last, (whole or _ONE) / beside)

    def _quotient(self, above: Node, below: Node, whole: Size | None) -> None:
        if self.size(above) is None:
            if self.size(below) is None:
                self.ask(below, None)
            self.ask(above, (whole or _ONE) * (self.size(below) or _ONE))
        else:
            self.ask(below, (self.size(above) or _ONE) / (whole or _ONE))

    def _turns(self, node: Node) -> None:
        """In an angle, a parameter that is added is a phase, and one that counts turns of an angle begins at one."""
        if node.kind in ("+", "-"):
            for one in node.operands:
                if one.kind == "parameter":
                    self.found.setdefault(int(one.value), Size(0.0, ANGLE))
                elif self.size(one) is None:
                    self._turns(one)
            return
        beside = [one for one in _factors(node) if self.size(one) is not None]
        if any(one.kind == "variable" and one.name == "theta" for one in beside):
            known = math.prod((self.size(one) or _ONE).value for one in beside)
            self.ask(node, Size(self._order * known, ANGLE))
        elif any((self.size(one) or _ONE).unit == ANGLE for one in beside):  # of the user: a quarter turn in its travel
            self.ask(node, Size(0.5 * math.pi, ANGLE))
        else:
            self.ask(node, Size(2.0 * math.pi, ANGLE))


def _factors(node: Node) -> list[Node]:
    """Of a product, whatever their signs."""
    return [one for part in node.operands for one in _factors(part)] if node.kind in ("*", "negative") else [node]
