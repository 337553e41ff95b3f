"""Where a fit of a user's expression begins: values with which each term is as large as the signals suggest.

Every part of an expression has a unit and a usual size: its variables' are measured, the whole is a torque of the size
that is left.  From the whole down to the parameters each has what is then missing: in c·ω it is T/ω, in tanh(ω/v) v is
as large as ω, in sin(hθ + φ) the phase is 0.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

from ema_model.effects.user.expression import Expression, Node

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
