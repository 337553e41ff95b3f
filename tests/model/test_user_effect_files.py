"""A user's effects in actuator files and on the command line."""

from __future__ import annotations

import json

import numpy as np
import pytest

from ema_model.actuator import load_actuator, save_actuator
from ema_model.actuator.file import shipped
from ema_model.actuator.parameters import Tolerance
from ema_model.commands import command
from ema_model.effects import find
from ema_model.effects.user import UserEffect, torque_curve, user_torque
from ema_model.errors import InputError
from ema_model.recordings.read import read_measurement
from ema_model.simulation.run import Run, simulate_monitor
from emaviz.cli import main
from emaviz.cli.flow import split_at_commas

OWN = """
[effects.user_torque]
expression = "c*omega + A*sin(7*theta)"
c = { value = -1e-4, sigma = 5e-5, low = -0.01, high = 0.0 }
A = 0.02

[effects.user_torque_2]
expression = "clamp(b*q, -d, d)"
b = -0.001
d = { value = 0.1, tolerance = 0.2, free = false }

[effects.torque_curve]
variable = "omega"
modulator = "sign_speed"
low = -500
high = 500.0
values = [-0.01, { value = -0.002, sigma = 0.005 }, -0.01]

[effects.torque_curve_theta]
variable = "theta"
low = 0.0
high = 6.283185307179586
values = [0.01, -0.01, 0.0]
"""


@pytest.fixture
def own(tmp_path):
    path = tmp_path / "own.toml"
    path.write_text(shipped("thesis.toml") + OWN, encoding="utf-8")
    return path


def test_file_makes_the_effects(own):
    actuator = load_actuator(own)
    torque, clamped, friction, turn = (find(name) for name in actuator.effects)
    assert torque.equation == "T = c*omega + A*sin(7*theta)" and clamped.equation == "T = clamp(b*q, -d, d)"
    assert (torque.parameters[0].low, torque.parameters[0].high) == (-0.01, 0.0)
    assert actuator.effects[torque.name] == {"c": -1e-4, "A": 0.02}
    assert list(actuator.effects[friction.name].values()) == [-0.01, -0.002, -0.01]
    assert isinstance(turn, UserEffect) and turn.definition["modulator"] == "1"
    expected = {
        f"effects.{torque.name}.c": Tolerance(5e-5, True),
        f"effects.{clamped.name}.d": Tolerance(0.02, False),
        f"effects.{friction.name}.knot_01": Tolerance(0.005, True),
    }
    found = {path: one for path, one in actuator.tolerances.items() if path.startswith("effects.")}
    assert {path: (one.sigma, one.free) for path, one in found.items()} == {
        path: (pytest.approx(one.sigma), one.free) for path, one in expected.items()
    }


def test_file_written_and_read_again_is_the_same_actuator(own, tmp_path):
    actuator = load_actuator(own)
    ranges = {p.name: (p.low, p.high) for name in actuator.effects for p in find(name).parameters}
    save_actuator(actuator, tmp_path / "again.toml")
    again = load_actuator(tmp_path / "again.toml")
    assert again == actuator
    assert ranges == {p.name: (p.low, p.high) for name in again.effects for p in find(name).parameters}
    text = (tmp_path / "again.toml").read_text(encoding="utf-8")
    for section in ("user_torque", "user_torque_2", "torque_curve", "torque_curve_2"):
        assert f"[effects.{section}]" in text
    save_actuator(again, tmp_path / "third.toml")
    assert (tmp_path / "third.toml").read_text(encoding="utf-8") == text


@pytest.mark.long
def test_effects_of_a_file_act_as_those_given_to_a_run(own):
    actuator, bare = load_actuator(own), load_actuator()
    run = Run(command("chirp"), 0.05)
    inside = simulate_monitor(run, actuator)["current_A"]
    assert np.array_equal(inside, simulate_monitor(run, bare, effects=actuator.effects)["current_A"])
    assert np.abs(inside - simulate_monitor(run, bare)["current_A"]).max() > 0.1


LINEAR_AXIS = """
[axes]
motor = "linear"
[controller]
kind = "unknown"
[motor]
force_constant_N_A = 10.0
mass_kg = 1.0
viscous_friction_Ns_m = 0.0
static_friction_N = 0.0
dynamic_friction_N = 0.0
[effects.user_torque]
expression = "level_Nm*theta + inertia*omega"
level_Nm = 2.0
inertia = 3.0
"""


def test_parameters_keep_the_names_of_their_expression_on_linear_axes(tmp_path):
    (tmp_path / "slide.toml").write_text(LINEAR_AXIS, encoding="utf-8")
    actuator = load_actuator(tmp_path / "slide.toml")
    save_actuator(actuator, tmp_path / "again.toml")
    assert "level_Nm = 2.0" in (tmp_path / "again.toml").read_text(encoding="utf-8")
    again = load_actuator(tmp_path / "again.toml")
    assert again.effects == actuator.effects and next(iter(again.effects.values())) == {"level_Nm": 2.0, "inertia": 3.0}


TORQUE, CURVE = "[effects.user_torque]", "[effects.torque_curve]"
MISTAKES = [
    ("A = 0.02", "", f"{TORQUE} lacks A"),
    ("A = 0.02", "A = 0.02\nB = 1.0", f"{TORQUE} has no 'B'; its expression has c, A"),
    ("A = 0.02", 'A = "much"', "[effects.user_torque] A must be a number, not 'much'"),
    ("A = 0.02", "A = [1, 2]", "[effects.user_torque] A must be a number"),
    ("A = 0.02", "A = nan", "[effects.user_torque] A must be a number"),
    ("A = 0.02", "A = 1e9", f"{TORQUE} effect user_torque_"),
    ("A = 0.02", "A = { sigma = 1 }", "[effects.user_torque] A takes value, tolerance or sigma, free"),
    ("A = 0.02", "A = { value = 1, worth = 2 }", "[effects.user_torque] A takes value, tolerance or sigma, free"),
    ("A = 0.02", "A = { value = 0.02, low = 1, high = 0 }", f"{TORQUE} the range of A must go from a number"),
    ("A = 0.02", 'A = { value = 0.02, low = "x" }', f"{TORQUE} low must be a number, not 'x'"),
    ("A = 0.02", "A = 1" + 400 * "0", "[effects.user_torque] A must be a number"),
    ("low = -0.01, high = 0.0", "low = 0.0, high = 1.0", "c = -0.0001 is outside 0 … 1"),
    ('expression = "c*omega + A*sin(7*theta)"', "", f"{TORQUE} needs expression = "),
    ('expression = "c*omega + A*sin(7*theta)"', "expression = 3", f"{TORQUE} needs expression = "),
    ("c*omega + A*sin(7*theta)", "c*omega + A*tan(7*theta)", f"{TORQUE} expression: column 13: unknown function 'tan'"),
    ("c*omega + A*sin(7*theta)", "__import__('os')", f"{TORQUE} expression: column 1: '_' cannot be used"),
    ("c*omega + A*sin(7*theta)", "c*A*expression", f"{TORQUE} expression: column 5: no parameter can be called"),
    ("[effects.user_torque]\n", "[effects]\nuser_torque = 3\n[effects.none]\n", "[user_torque] must be a table"),
    ('"clamp(b*q, -d, d)"\nb', '"c*omega + A*sin(7*theta)"\nA = 1\nc', "[effects.user_torque_2] has no 'd'"),
    ("[effects.user_torque_2]", "[effects.user-torque]", "[effects] no effect 'user-torque'"),
    ('variable = "omega"', "", f"{CURVE} lacks variable"),
    ('variable = "omega"', 'variable = "time"', f"{CURVE} no variable 'time' for a torque curve; variables are theta"),
    ('modulator = "sign_speed"', 'modulator = "load"', f"{CURVE} no modulator 'load'"),
    ('modulator = "sign_speed"', 'colour = "red"', f"{CURVE} has no 'colour'; it has variable, modulator, low, high"),
    ("low = -500", 'low = "a"', f"{CURVE} low must be a number, not 'a'"),
    ("low = -500", "low = 500", f"{CURVE} a torque curve must go from a number to a larger one"),
    ("values = [-0.01, {", "values = [{", f"{CURVE} a torque curve needs a row of 2 to 24 knots"),
    ("values = [-0.01,", "values = [true,", f"{CURVE} value 0 of the curve must be a number, not 'True'"),
    ("values = [-0.01,", "values = [{ sigma = 1 },", f"{CURVE} value 0 of the curve must be a number, not 'None'"),
    ("values = [0.01, -0.01, 0.0]", "values = 3", "[effects.torque_curve_theta] values must be a list of numbers"),
]


@pytest.mark.parametrize(
    ("old", "new", "says"), MISTAKES, ids=[new[:30] or f"no {old[:20]}" for old, new, _ in MISTAKES]
)
def test_mistakes_in_the_file_are_one_clear_line(own, old, new, says):
    text = own.read_text(encoding="utf-8")
    assert old in text
    if "needs a row" in says:
        new, old = "values = [1.0]", "values = [-0.01, { value = -0.002, sigma = 0.005 }, -0.01]"
    own.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError) as error:
        load_actuator(own)
    line = str(error.value)
    assert says in line and str(own) in line and "\n" not in line and len(line) < 600


def test_the_same_effect_twice_is_refused(own):
    with own.open("a", encoding="utf-8") as file:
        file.write('[effects.user_torque_3]\nexpression = "c*omega + A*sin(7*theta)"\nc = 0.0\nA = 1.0\n')
    with pytest.raises(InputError, match=r"\[effects.user_torque_3\] is the same as another one"):
        load_actuator(own)


# --- the command line -------------------------------------------------------------------------------------------------


def simulated(tmp_path, *effects: str) -> np.ndarray:
    out = tmp_path / "run.csv"
    options = [part for effect in effects for part in ("--effect", effect)]
    assert main(["simulate", "--model", "mm", "--duration", "0.05", "--force", "--out", str(out), *options]) == 0
    return read_measurement(out)["current_A"]


@pytest.mark.long
def test_expression_and_curve_on_the_command_line(tmp_path):
    run = Run(command("chirp"), 0.05)
    own = user_torque("min(c*omega, 0) - A*sign(omega)")
    found = simulated(tmp_path, "user_torque:expression=min(c*omega, 0) - A*sign(omega), c=-1e-4, A=0.02")
    expected = simulate_monitor(run, load_actuator(), effects={own.name: {"c": -1e-4, "A": 0.02}})["current_A"]
    np.testing.assert_allclose(found, expected, atol=1e-6)
    curve = torque_curve([0.02, 0.0, -0.02], -0.05, 0.05, "user")
    text = "torque_curve:variable=user,low=-0.05,high=0.05,values=[0.02,0,-0.02]"
    expected = simulate_monitor(run, load_actuator(), effects={curve.name: {}})["current_A"]
    np.testing.assert_allclose(simulated(tmp_path, text), expected, atol=1e-6)


@pytest.mark.long
def test_several_own_torques_add_up(tmp_path):
    both = simulated(tmp_path, "user_torque:expression=-c*omega,c=1e-4", "user_torque:expression=-d*sign(omega),d=0.02")
    one = simulated(tmp_path, "user_torque:expression=-c*omega - d*sign(omega),c=1e-4,d=0.02")
    np.testing.assert_allclose(both, one, atol=1e-6)


@pytest.mark.long
def test_compare_takes_an_own_torque(tmp_path, capsys):
    recording, result = tmp_path / "run.csv", tmp_path / "result.json"
    effect = "user_torque:expression=-d*sign(omega),d=0.02"
    make = ["simulate", "--command", "sine", "--set", "amplitude_rad=0.01", "--set", "frequency_Hz=10"]
    assert main([*make, "--duration", "0.2", "--effect", effect, "--out", str(recording)]) == 0
    rmse = []
    for options in ([], ["--effect", effect]):
        assert main(["compare", str(recording), "--no-calibrate", "--json", str(result), *options]) == 0
        rmse.append(json.loads(result.read_text())["signals"]["current_A"]["rmse"])
    assert rmse[1] < 0.5 * rmse[0]


@pytest.mark.parametrize(("effect", "says"), [
    ("user_torque", "--effect user_torque: needs expression"),
    ("user_torque:expression=c*omega", "--effect user_torque: lacks c"),
    ("user_torque:expression=c*omega,c=x", "--effect user_torque: c=x: write it as name=number"),
    ("user_torque:expression=c*omega,c", "--effect user_torque: c: write it as name=value"),
    ("user_torque:expression=c*omega,c=nan", "c = nan is outside"),
    ("user_torque:expression=c*omega,c=[1]", "--effect user_torque: c=[1]: write it as name=number"),
    ("user_torque:expression=c*tan(omega),c=1", "--effect user_torque: expression: column 3: unknown function 'tan'"),
    ("user_torque:expression=c*sin(omega,c=1", "expression: column"),
    ("torque_curve:variable=theta,low=0,high=1,values=[a,b]", "values=[a,b]: write it as values=[number,number,…]"),
    ("torque_curve:variable=theta,low=0,high=1,values=2", "needs a row of 2 to 24 knots"),
])  # fmt: skip
def test_mistakes_on_the_command_line_are_one_clear_line(tmp_path, capsys, effect, says):
    out = tmp_path / "run.csv"
    assert main(["simulate", "--model", "mm", "--out", str(out), "--effect", effect]) == 2
    told = capsys.readouterr().err.strip()
    assert says in told and "\n" not in told and not out.exists()


def test_the_same_effect_twice_on_the_command_line_is_refused(tmp_path, capsys):
    twice = [part for c in (1, 2) for part in ("--effect", f"user_torque:expression=c*omega,c={c}e-5")]
    assert main(["simulate", "--model", "mm", "--out", str(tmp_path / "run.csv"), *twice]) == 2
    assert "--effect user_torque: given twice" in capsys.readouterr().err


def test_commas_within_parentheses_and_brackets_stay():
    assert split_at_commas("a=min(x,max(y,z)),b=[1,2],,c=3") == ["a=min(x,max(y,z))", "b=[1,2]", "c=3"]
    assert split_at_commas("a=1),b=2") == ["a=1)", "b=2"]
    assert split_at_commas("") == []
