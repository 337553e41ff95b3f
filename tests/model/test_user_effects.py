"""The user's own torque: values, registration, action in the models."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import ema_model
from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.effects import CATALOGUE, Effect, find
from ema_model.effects.user import torque_curve, user_torque
from ema_model.errors import InputError
from ema_model.faults import HEALTHY
from ema_model.identification.search import Objective
from ema_model.models import ClosedLoop, InverseDynamics
from ema_model.recordings import Measurement
from ema_model.simulation.plant import simulated
from ema_model.simulation.run import Run, simulate_monitor, simulate_reference
from ema_model.stacks import find_stack

ACTUATOR = load_actuator()
RUN = Run(command("chirp"), 0.1)
TURN = 2.0 * np.pi


def torques(effect: Effect, theta, omega, current, user, *own) -> np.ndarray:
    """The effect's torque, N·m, at each of the points (n,), through its compiled function."""
    shaft_torque = effect.places[0]
    points = zip(theta, omega, current, user)
    return np.array([shaft_torque(0.0, x, w, q, u, 0.01, 0.0, 0.0, *own) for x, w, q, u in points])


def points(n: int = 300) -> list[np.ndarray]:
    """theta, omega, current, user; each with a zero."""
    rng = np.random.default_rng(3)
    return [np.append(rng.uniform(-high, high, n), 0.0) for high in (40.0, 900.0, 25.0, 0.5)]


# --- values -----------------------------------------------------------------------------------------------------------

VALUES: list[tuple[str, Callable[..., np.ndarray]]] = [
    ("a*sin(7*theta + b)/2", lambda x, w, q, u, a, b: a * np.sin(7 * x + b) / 2),
    ("cos(a*theta) + b", lambda x, w, q, u, a, b: np.cos(a * x) + b),
    ("a*omega*abs(omega)*1e-6 + b*sign(omega)", lambda x, w, q, u, a, b: a * w * np.abs(w) * 1e-6 + b * np.sign(w)),
    ("a*tanh(omega/b) + user**3", lambda x, w, q, u, a, b: a * np.tanh(w / b) + u**3),
    ("a*exp(-(omega/20)**2) + b*exp(user*4)", lambda x, w, q, u, a, b: (
        a * np.exp(-((w / 20) ** 2)) + b * np.exp(4 * u)
    )),
    ("min(a, q) + max(b, user) + clamp(q, -a, b)", lambda x, w, q, u, a, b: (
        np.minimum(a, q) + np.maximum(b, u) + np.clip(q, -a, b)
    )),
    ("a*sqrt(abs(omega)) + b*abs(q)**1.5", lambda x, w, q, u, a, b: a * np.sqrt(np.abs(w)) + b * np.abs(q) ** 1.5),
    ("abs(user)**a + abs(user)**0.3 + abs(q)**(b - 1)", lambda x, w, q, u, a, b: (
        np.abs(u) ** a + np.abs(u) ** 0.3 + np.abs(q) ** (b - 1)
    )),
    ("a - -b*2**-3 + (1 + q**2)**-1 + +pi/4", lambda x, w, q, u, a, b: a + b / 8 + 1 / (1 + q**2) + np.pi / 4),
    ("a*2-3-b*(user-1)/2/4", lambda x, w, q, u, a, b: a * 2 - 3 - b * (u - 1) / 2 / 4),
    ("-a**2 + b*2**(1/2)", lambda x, w, q, u, a, b: -(a**2) + b * np.sqrt(2.0) + 0 * x),
]  # fmt: skip


@pytest.mark.parametrize(("text", "expected"), VALUES, ids=[text for text, _ in VALUES])
def test_values_are_those_of_numpy(text, expected):
    effect = user_torque(text)
    assert [p.name for p in effect.parameters] == ["a", "b"]
    at = points()
    np.testing.assert_allclose(torques(effect, *at, 1.3, 2.1), expected(*at, 1.3, 2.1), rtol=1e-6, atol=1e-6)


def test_large_exponentials_keep_their_relative_accuracy():
    shaft_torque = user_torque("exp(theta)").places[0]
    x = np.linspace(-700.0, 700.0, 401)
    found = np.array([shaft_torque(0.0, one, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0) for one in x])
    np.testing.assert_allclose(found, np.exp(x), rtol=1e-9)
    assert shaft_torque(0.0, -800.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0) == 0.0


@pytest.mark.parametrize(("modulator", "factor"), [
    ("1", lambda w, q: 1.0), ("sign_speed", lambda w, q: np.sign(w)), ("current", lambda w, q: q),
])  # fmt: skip
@pytest.mark.parametrize(("variable", "column"), [("theta", 0), ("omega", 1), ("q", 2), ("user", 3)])
def test_curve_is_numpys_interpolation(variable, column, modulator, factor):
    at = points()
    high = 0.8 * at[column].max()
    low = -0.5 * high
    values = np.random.default_rng(1).normal(size=24)
    effect = torque_curve(values, low, high, variable, modulator)
    assert [p.name for p in effect.parameters] == [f"knot_{j:02d}" for j in range(24)]
    own = [p.default for p in effect.parameters]
    expected = np.interp(at[column], np.linspace(low, high, 24), values) * factor(at[1], at[2])
    np.testing.assert_allclose(torques(effect, *at, *own), expected, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("parts", [1, 7])
def test_curve_over_a_turn_of_the_motor_repeats(parts):
    values, period = [0.1, -0.4, 0.3, 0.2, 0.5], TURN / parts
    effect = torque_curve(values, 0.3, 0.3 + period)
    at = points()
    expected = np.interp(at[0], 0.3 + period / 5 * np.arange(5), values, period=period)
    np.testing.assert_allclose(torques(effect, *at, *values), expected, rtol=1e-6, atol=1e-6)


# --- parameters and registration --------------------------------------------------------------------------------------


def test_parameters_their_ranges_and_defaults():
    effect = user_torque("gain*omega + level*sin(order*theta) + offset", {"gain": (-1e-3, 1e-3), "order": (2.0, 40.0)})
    found = {p.name: (p.default, p.low, p.high) for p in effect.parameters}
    assert list(found) == ["gain", "level", "order", "offset"]
    assert found["gain"] == (1e-3, -1e-3, 1e-3)
    assert found["level"] == (1.0, -1e3, 1e3)
    assert found["order"] == (2.0, 2.0, 40.0)
    with pytest.raises(InputError, match="gain = 1 is outside"):
        effect.settings({"gain": 1.0})


def test_effect_is_found_by_its_name_and_the_catalogue_stays():
    before = dict(CATALOGUE)
    effect = user_torque("level*omega")
    assert re.fullmatch(r"user_torque_[0-9a-f]{12}", effect.name)
    assert find(effect.name) is effect
    assert before == CATALOGUE
    again = user_torque("level*omega", {"level": (0.0, 2.0)})
    assert again.name == effect.name and find(effect.name) is again
    assert user_torque("level*omega*1").name != effect.name
    stack = find_stack("reduced", [effect.name, "cogging_torque"])
    assert f"{effect.name}.level" in stack.parameter_rows


@pytest.mark.parametrize(("ranges", "message"), [
    ({"b": (0.0, 1.0)}, "no parameter 'b'; it has a"),
    ({"a": (1.0, 1.0)}, "must go from a number to a larger one"),
    ({"a": (0.0, np.nan)}, "must go from a number to a larger one"),
])  # fmt: skip
def test_wrong_ranges_are_refused(ranges, message):
    with pytest.raises(InputError, match=message):
        user_torque("a*theta", ranges)


@pytest.mark.parametrize(("arguments", "message"), [
    (([1.0], 0.0, 1.0), "2 to 24 knots"),
    ((np.zeros(25), 0.0, 1.0), "2 to 24 knots"),
    ((np.zeros((3, 3)), 0.0, 1.0), "2 to 24 knots"),
    (([0.0, np.nan], 0.0, 1.0), "knot 1 of the torque curve is nan"),
    ((["x", "y"], 0.0, 1.0), "must be numbers"),
    (([0.0, 1.0], 1.0, 1.0), "to a larger one"),
    (([0.0, 1.0], 0.0, np.inf), "to a larger one"),
    (([0.0, 1.0], 0.0, 1.0, "time"), "variables are theta, omega, user, q, load"),
    (([0.0, 1.0], 0.0, 1.0, "theta", "load"), "modulators are 1, sign_speed, current"),
])  # fmt: skip
def test_wrong_curves_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        torque_curve(*arguments)


# --- in the models ----------------------------------------------------------------------------------------------------


def currents(effects: dict, simulate: Callable[..., Measurement] = simulate_monitor) -> np.ndarray:
    return simulate(RUN, ACTUATOR, effects=effects)["current_A"]


@pytest.mark.long
@pytest.mark.parametrize("simulate", [simulate_monitor, simulate_reference])
def test_expression_of_cogging_is_the_effect_of_the_library(simulate):
    effect = user_torque("A*sin(h*theta + f)")
    own = currents({effect.name: {"A": 0.03, "h": 12.0, "f": 0.4}}, simulate)
    library = {"cogging_torque": {"amplitude_Nm": 0.03, "order": 12.0, "phase_rad": 0.4}}
    expected = currents(library, simulate)
    assert np.abs(expected - currents({}, simulate)).max() > 0.1
    np.testing.assert_allclose(own, expected, rtol=0.0, atol=1e-6)


@pytest.mark.long
def test_the_same_formula_with_other_names_is_an_effect_of_its_own():
    one, other = user_torque("-c*omega"), user_torque("-d*omega")
    assert one.name != other.name
    both = currents({one.name: {"c": 1e-4}, other.name: {"d": 2e-4}})
    np.testing.assert_allclose(both, currents({other.name: {"d": 3e-4}}), atol=1e-6)
    np.testing.assert_allclose(both, currents({one.name: {"c": 3e-4}}), atol=1e-6)


@pytest.mark.long
def test_time_counts_from_the_start_of_the_run():
    late = user_torque("level*clamp((t - 0.06)*1e4, 0, 1)")
    difference = currents({late.name: {"level": 0.05}}) - currents({late.name: {"level": 0.0}})
    before = RUN.time_s < 0.06 - 1e-4
    assert np.all(difference[before] == 0.0)
    assert np.abs(difference[~before]).max() > 0.1


@pytest.mark.long
def test_curve_of_many_knots_acts_in_the_model_as_its_formula_does():
    knots = 0.02 * np.sin(TURN * np.arange(24) / 24)
    curve = torque_curve(knots, 0.0, TURN)
    sine = user_torque("A*sin(theta)")
    expected = currents({sine.name: {"A": 0.02}})
    change = np.abs(expected - currents({})).max()
    assert change > 0.1
    assert np.abs(currents({curve.name: {}}) - expected).max() < 0.05 * change


@pytest.mark.long
@pytest.mark.parametrize("wrong", [{"b": 0.0}, {"c": -1.0}, {"d": 1000.0}, {"a": 0.0, "b": 0.0}, {"e": 0.0}])
def test_no_value_at_run_time_is_a_failed_candidate_and_no_crash(wrong):
    effect = user_torque("1e-9*(a/b + sqrt(c) + exp(d) + e**-3 + theta)")
    recording = simulated(RUN, ACTUATOR, HEALTHY)
    k = np.tile(HEALTHY, (3, 1))
    assert np.all(np.isfinite(Objective([recording], ACTUATOR, effects={effect.name: {}})(k)))
    assert np.all(Objective([recording], ACTUATOR, effects={effect.name: wrong})(k) == np.inf)
    with pytest.raises(FloatingPointError, match="diverged"):
        simulate_monitor(RUN, ACTUATOR, effects={effect.name: wrong})


@pytest.mark.long
def test_a_failed_lane_leaves_the_others_untouched():
    effect = user_torque("1e-3*(sqrt(a)/b + exp(c))*theta")
    plant = ClosedLoop([simulated(RUN, ACTUATOR, HEALTHY)], ACTUATOR, effects={effect.name: {}})
    lanes = 40  # more than a block
    values = {name: np.full(lanes, 1.0) for name in "abc"}
    values["b"] = np.linspace(1.0, 3.0, lanes)
    k = np.tile(HEALTHY, (lanes, 1))
    sound = plant.signals(0, k=k, effects={effect.name: values})
    assert all(np.isfinite(signal).all() for signal in sound.values())
    bad = {3: ("b", 0.0), 17: ("a", -1.0), 35: ("c", 999.0)}
    for lane, (name, value) in bad.items():
        values[name] = values[name].copy()
        values[name][lane] = value
    found = plant.signals(0, k=k, effects={effect.name: values})
    others = [lane for lane in range(lanes) if lane not in bad]
    for name, signal in found.items():
        assert np.array_equal(signal[others], sound[name][others])
    for lane in bad:
        assert np.isnan(found["current_A"][lane]).any() and np.isnan(found["user_position_rad"][lane]).any()


DRIVES = [("position", "voltage"), ("position", "current"), ("cascade", "current")]


@pytest.mark.long
@pytest.mark.parametrize(("controller", "drive"), DRIVES)
def test_no_drive_hides_a_torque_without_value(controller, drive):
    actuator = replace(
        ACTUATOR,
        controller=replace(ACTUATOR.controller, kind=controller, gain_1_rad=20.0),
        inverter=replace(ACTUATOR.inverter, kind=drive, current_limit_A=20.0),
    )
    effect = user_torque("1e-3*(a/b + sqrt(c))")
    run = Run(command("sine", {"amplitude_rad": 0.01, "frequency_Hz": 20}), 0.02)
    assert np.isfinite(simulate_monitor(run, actuator, effects={effect.name: {}})["current_A"]).all()
    for wrong in ({"b": 0.0}, {"a": 0.0, "b": 0.0}, {"c": -1.0}):
        with pytest.raises(FloatingPointError, match="diverged"):
            simulate_monitor(run, actuator, effects={effect.name: wrong})


def test_inverse_dynamics_shows_a_torque_without_value():
    effect = user_torque("sqrt(a)*1e-3")
    actuator = replace(ACTUATOR, controller=replace(ACTUATOR.controller, kind="unknown"))
    plant = InverseDynamics([simulate_monitor(RUN, ACTUATOR)], actuator, effects={effect.name: {}})
    a = np.array([1.0, -1.0, 4.0])
    current = plant.signals(0, k=np.tile(HEALTHY, (3, 1)), effects={effect.name: {"a": a}})["current_A"]
    assert np.isfinite(current[[0, 2]]).all() and np.isnan(current[1]).all()
    np.testing.assert_allclose(current[0] - current[2], 1e-3 / ACTUATOR.motor.torque_constant_Nm_A, rtol=1e-6)


PROGRAM = """
from ema_model.actuator import load_actuator
from ema_model.simulation.run import Run, simulate_monitor
from ema_model.effects.user import user_torque
effect = user_torque("A*tanh(omega/w) - t*B")
s = simulate_monitor(Run(duration_s=0.02), load_actuator(), effects={effect.name: {"A": 0.01}})
print("RESULT", effect.name, repr(float((s["current_A"] ** 2).mean())))
"""


@pytest.mark.long
def test_another_process_finds_the_compiled_kernel_again(tmp_path):
    parent = Path(ema_model.__file__).parents[1]
    env = {**os.environ, "PYTHONPATH": str(parent), "EMAVIZ_CACHE_DIR": str(tmp_path)}
    answers, caches = [], []
    for _ in range(2):
        done = subprocess.run([sys.executable, "-c", PROGRAM], env=env, text=True, capture_output=True, timeout=180)
        assert done.returncode == 0, done.stderr[-2000:]
        answers.append(done.stdout)
        caches.append({p: p.stat().st_mtime_ns for p in tmp_path.rglob("*.nbc")})
    assert answers[0] == answers[1] and "RESULT user_torque_" in answers[0]
    assert caches[0] and caches[0] == caches[1], "the second process compiled again"
