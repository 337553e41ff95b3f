"""Where a user's parameters begin: each as large as its unit and the signals suggest, no speed at a thousandth."""

from __future__ import annotations

import math

import pytest

from ema_model.effects.user import parse
from ema_model.effects.user.expression import beginnings

TORQUE = 0.003
SIZES = {"t": 0.5, "theta": 2.0, "omega": 90.0, "q": 2.0, "user": 0.005}


@pytest.mark.parametrize(
    ("text", "values", "units"),
    [
        ("c*omega", {"c": TORQUE / 90.0}, {"c": "N·m·s/rad"}),
        ("-c*sign(omega)*sqrt(abs(omega))", {"c": TORQUE / math.sqrt(90.0)}, {"c": "N·m·s^½/rad^½"}),
        ("-c*tanh(omega/v)", {"c": TORQUE, "v": 90.0}, {"c": "N·m", "v": "rad/s"}),
        (
            "-f*sign(omega)*(1 + a*exp(-(omega/v)**2))",
            {"f": TORQUE, "a": 1.0, "v": 90.0},
            {"f": "N·m", "a": "–", "v": "rad/s"},
        ),
        ("c*omega/(omega + v)", {"c": TORQUE, "v": 90.0}, {"c": "N·m", "v": "rad/s"}),
        ("k*(user - u0)", {"k": TORQUE / 0.005, "u0": 0.005}, {"k": "N·m/rad", "u0": "rad"}),
        ("k*user + c*omega", {"k": 0.6, "c": TORQUE / 90.0}, {"k": "N·m/rad", "c": "N·m·s/rad"}),
        ("a*omega**2", {"a": TORQUE / 8100.0}, {"a": "N·m·s²/rad²"}),
        ("m*q", {"m": 0.0015}, {"m": "N·m/A"}),
        ("A*sin(h*theta + phi)", {"A": TORQUE, "h": 12.0, "phi": 0.0}, {"A": "N·m", "h": "–", "phi": "rad"}),
        ("A*sin(h*user)", {"A": TORQUE, "h": 0.5 * math.pi / 0.005}, {"h": "–"}),
        ("A*sin(w*t)", {"A": TORQUE, "w": 2.0 * math.pi / 0.5}, {"w": "rad/s"}),
        ("A*exp(-t/tau)", {"A": TORQUE, "tau": 0.5}, {"tau": "s"}),
        ("clamp(c*omega, -m, m)", {"c": TORQUE / 90.0, "m": TORQUE}, {"m": "N·m"}),
        ("c", {"c": TORQUE}, {"c": "N·m"}),
    ],
)
def test_a_parameter_begins_where_its_term_is_as_large_as_what_is_left(text, values, units):
    found = beginnings(parse(text), TORQUE, SIZES, order=12.0)
    assert {name: one.value for name, one in found.items()} == pytest.approx(values)
    assert {name: found[name].words for name in units} == units


@pytest.mark.parametrize("text", ["a/b", "a**b", "sqrt(a)*max(b, c)", "sin(a)*cos(b)", "2.5", "a/(b/c)", "0*a + t"])
def test_every_expression_has_a_beginning_for_each_parameter(text):
    expression = parse(text)
    found = beginnings(expression, 0.0, {"t": 0.0})
    assert [*found] == [*expression.parameters]
    assert all(math.isfinite(one.value) for one in found.values())
