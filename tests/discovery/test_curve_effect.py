"""The curve of an unknown effect: read off the residual with the right sign and unit, fitted, and the error falls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.hidden_effects import ACTUATOR, SINE, recorded

from ema_model.actuator import load_actuator, save_actuator
from ema_model.actuator.parameters import Controller, Inverter
from ema_model.comparison.explain import Explanation, explain
from ema_model.comparison.residuals import Residuals, residuals_of
from ema_model.discovery.curve import curve_of, is_torque, with_curve
from ema_model.effects import find
from ema_model.effects.user import torque_curve, user_torque
from ema_model.errors import InputError
from ema_model.estimation.model_fit import Data, Fit, fit, gather, holdout_error
from ema_model.estimation.noise import as_it_is, twin_error
from ema_model.recordings import prepared

COMMANDS = [("chirp", {}, 0.5), ("step", {"final_rad": 0.005}, 0.5), SINE]
UNSEEN = [("sine", {"amplitude_rad": 0.02, "frequency_Hz": 5}, 0.6)]
SIGNALS = dict.fromkeys(("current_A", "motor_position_rad", "user_position_rad"), 1.0)
CONSTANT = ACTUATOR.motor.torque_constant_Nm_A
TURN = 2.0 * np.pi


# --- on a real residual ---------------------------------------------------------------------------------------------


def data_of(commands, effects, seed: int) -> Data:
    inside = [prepared(one, ACTUATOR) for one in recorded(seed, commands=commands, effects=effects)]
    return gather(inside, ACTUATOR, SIGNALS, [None] * len(inside))


def explained(data: Data, found: Fit) -> Explanation:
    fitted, k = found.calibration.actuator, found.calibration.k
    known = [as_it_is(twin_error(found.plant, place, fitted, k)) for place in range(len(found.plant.windows))]
    model = found.calibration.actuator
    residuals = residuals_of(found.plant, data.floors, found.calibration.signals, known, model, found.calibration)
    return explain(residuals, "current_A", ACTUATOR.axes)[0]


OUTSIDE_THE_LIBRARY = [
    ("-c*sqrt(abs(omega))*sign(omega)", {"c": 3e-3}, "motor_speed", lambda w: -3e-3 * np.sqrt(np.abs(w)) * np.sign(w)),
    ("A*sin(theta)**3", {"A": 0.02}, "motor_angle", lambda angle: 0.02 * np.sin(angle) ** 3),
]


@pytest.mark.long
@pytest.mark.parametrize(("text", "settings", "variable", "truth"), OUTSIDE_THE_LIBRARY, ids=["speed", "angle"])
def test_curve_of_a_hidden_torque_brings_the_held_out_error_to_the_floor(text, settings, variable, truth, tmp_path):
    effects = {user_torque(text).name: settings}
    data, held = data_of(COMMANDS, effects, 11), data_of(UNSEEN, effects, 11)
    base = fit(data, ACTUATOR)
    explanation = explained(data, base)
    assert explanation.significant and explanation.variable == variable
    actuator, name = with_curve(data, base, explanation)
    improved = fit(data, actuator, base.starts)
    assert improved.calibration.converged
    before, after = holdout_error(held, base), holdout_error(held, improved)
    assert before > 1.5 and after - 1.0 < 0.2 * (before - 1.0) and after < 1.1

    save_actuator(improved.calibration.actuator, tmp_path / "improved.toml")
    assert load_actuator(tmp_path / "improved.toml") == improved.calibration.actuator

    effect = find(name)
    knots = np.array(list(improved.calibration.actuator.effects[name].values()))
    definition = effect.definition
    at = np.linspace(definition["low"], definition["high"], len(knots), endpoint=variable != "motor_angle")
    expected = truth(at)
    # What base parameters within their tolerances do as well is not told from the curve: a part of it is theirs.
    share = 1.0 if variable == "motor_angle" else float(knots @ expected / (expected @ expected))
    assert 0.6 < share < 1.2
    assert np.sqrt(np.mean((knots - share * expected) ** 2)) < 0.2 * np.sqrt(np.mean(expected**2))


# --- on residuals made by hand --------------------------------------------------------------------------------------


def residuals(signal: str, values: np.ndarray, **variables: np.ndarray) -> Residuals:
    n = len(values)
    speed = variables.setdefault("motor_speed", 50.0 + np.arange(n) / n)
    assert len(speed) == n
    return Residuals(
        time_s=np.arange(n) * 1e-3,
        values={signal: values},
        sigma={signal: np.full(n, 0.01 * float(np.std(values)))},
        noise={signal: np.full(n, 0.01 * float(np.std(values)))},
        white={signal: np.full(n, 0.01 * float(np.std(values)))},
        variables=variables,
        recording=np.zeros(n, np.intp),
        run=np.zeros(n, np.intp),
        saturated=np.zeros(n, np.bool_),
        block_s=1e-3,
    )


def explanation(signal: str, variable: str, modulator: str = "1") -> Explanation:
    none = np.zeros(0)
    return Explanation(signal, variable, modulator, 1.0, 1.0, True, none, none, none, "")


def torque(effect, **at: float) -> float:
    """Of a curve with its own knots, N·m."""
    arguments = {"torque": 0.0, "theta": 0.0, "omega": 0.0, "current": 0.0, "user": 0.0, "gear": 0.0, "load": 0.0}
    arguments |= {"time": 0.0}
    return effect.places[0](*(arguments | at).values(), *(parameter.default for parameter in effect.parameters))


RANDOM = np.random.default_rng(8)
SPEED = RANDOM.uniform(-100.0, 300.0, 4000)


def test_more_current_than_the_model_is_a_torque_against_it():
    y = 0.2 + 1e-3 * SPEED
    effect = curve_of(residuals("current_A", y, motor_speed=SPEED), explanation("current_A", "motor_speed"), ACTUATOR)
    assert effect.definition["modulator"] == "1" and len(effect.parameters) == 24
    assert torque(effect, omega=200.0) == pytest.approx(-CONSTANT * 0.4, rel=1e-3)
    assert torque(effect, omega=-50.0) == pytest.approx(-CONSTANT * 0.15, rel=1e-3)
    measured = residuals("motor_torque_Nm", y, motor_speed=SPEED)
    effect = curve_of(measured, explanation("motor_torque_Nm", "motor_speed"), ACTUATOR)
    assert torque(effect, omega=200.0) == pytest.approx(-0.4, rel=1e-3)


def test_position_beyond_the_models_is_a_push_against_the_loops_stiffness():
    position = RANDOM.uniform(-0.03, 0.03, 4000)
    y = 1e-3 * position
    stiffness = ACTUATOR.controller.speed_gain_Nms_rad * ACTUATOR.controller.position_gain_1_s
    made = residuals("user_position_rad", y, user_position=position)
    effect = curve_of(made, explanation("user_position_rad", "user_position"), ACTUATOR)
    assert torque(effect, user=0.02) == pytest.approx(stiffness * 2e-5, rel=1e-3)
    servo = replace(
        ACTUATOR,
        controller=Controller(kind="position", gain_1_rad=8.0, output_limit=0.5),
        inverter=Inverter(kind="current", current_limit_A=10.0),
    )
    effect = curve_of(made, explanation("user_position_rad", "user_position"), servo)
    assert torque(effect, user=0.02) == pytest.approx(8.0 * 0.5 * 10.0 * CONSTANT * 2e-5, rel=1e-3)


def test_jump_with_the_direction_becomes_a_curve_times_its_sign():
    y = np.sign(SPEED) * (0.3 + 0.2 * np.exp(-np.abs(SPEED) / 50.0))
    effect = curve_of(residuals("current_A", y, motor_speed=SPEED), explanation("current_A", "motor_speed"), ACTUATOR)
    assert effect.definition["modulator"] == "sign_speed"
    for omega in (-60.0, -2.0, 2.0, 250.0):
        level = 0.3 + 0.2 * np.exp(-np.abs(omega) / 50.0)
        assert torque(effect, omega=omega) == pytest.approx(-CONSTANT * np.sign(omega) * level, rel=0.05)


def test_modulators_of_the_explanation_are_kept():
    angle, current = RANDOM.uniform(0.0, 5.0 * TURN, 4000), RANDOM.uniform(-5.0, 5.0, 4000)
    y = current * 0.1 * np.cos(angle)
    made = residuals("current_A", y, motor_angle=angle, current=current)
    effect = curve_of(made, explanation("current_A", "motor_angle", "current"), ACTUATOR)
    assert effect.definition["modulator"] == "current"
    assert torque(effect, theta=TURN, current=-3.0) == pytest.approx(CONSTANT * 0.3, rel=0.02)


@pytest.mark.parametrize(("order", "parts"), [(1, 1), (3, 3), (36, 36)])
def test_angle_repeats_over_the_turn_or_the_fraction_that_the_residual_asks_for(order, parts):
    angle = RANDOM.uniform(-20.0, 20.0, 6000)
    y = np.sin(order * angle) ** 3
    made = residuals("current_A", y, motor_angle=angle)
    effect = curve_of(made, explanation("current_A", "motor_angle"), ACTUATOR)
    assert effect.definition["high"] == pytest.approx(TURN / parts)
    shown = np.array([torque(effect, theta=one) for one in angle[:300]])
    assert np.sqrt(np.mean((shown + CONSTANT * y[:300]) ** 2)) < 0.1 * CONSTANT


def test_angle_of_less_than_a_turn_does_not_repeat():
    angle = RANDOM.uniform(10.0, 12.0, 400)
    made = residuals("current_A", angle - 11.0, motor_angle=angle)
    effect = curve_of(made, explanation("current_A", "motor_angle"), ACTUATOR)
    assert effect.definition["low"] == pytest.approx(10.0, abs=0.05) and len(effect.parameters) == 20
    assert torque(effect, theta=11.5) == pytest.approx(-0.5 * CONSTANT, rel=0.02)
    assert torque(effect, theta=50.0) == pytest.approx(-CONSTANT, rel=0.05)


def test_knots_that_no_data_reach_bridge_the_gap():
    position = np.concatenate([RANDOM.uniform(-1.0, -0.5, 1000), RANDOM.uniform(0.5, 1.0, 1000)])
    made = residuals("current_A", 0.4 * position, user_position=position)
    effect = curve_of(made, explanation("current_A", "user_position"), ACTUATOR)
    assert torque(effect, user=0.2) == pytest.approx(-CONSTANT * 0.08, rel=0.05)


def test_what_is_no_torque_at_the_shaft_is_told():
    assert is_torque(explanation("current_A", "load"), ACTUATOR)
    assert not is_torque(explanation("current_A", "acceleration"), ACTUATOR)
    unknown = replace(ACTUATOR, controller=Controller(kind="unknown"))
    assert is_torque(explanation("current_A", "motor_speed"), unknown)
    assert not is_torque(explanation("user_position_rad", "motor_speed"), unknown)


@pytest.mark.long
def test_knots_are_free_and_the_rest_of_the_actuator_stays():
    data = data_of([SINE], {"cogging_torque": {"amplitude_Nm": 0.03}}, 5)
    base = fit(data, ACTUATOR)
    actuator, name = with_curve(data, base, explained(data, base))
    assert {path for path in actuator.tolerances if path not in ACTUATOR.tolerances} == {
        f"effects.{name}.{parameter.name}" for parameter in find(name).parameters
    }
    assert all(one.free and one.sigma > 0.0 for path, one in actuator.tolerances.items() if path.startswith("effects."))
    assert replace(actuator, effects={}, tolerances=ACTUATOR.tolerances) == ACTUATOR
    with pytest.raises(InputError, match="over temperature cannot be made a torque curve; variables are motor_angle"):
        with_curve(data, base, explanation("current_A", "temperature"))


def test_a_torque_over_time_becomes_a_curve_over_it():
    assert is_torque(explanation("current_A", "time"), ACTUATOR)
    curve = torque_curve([0.0, 0.2, 0.1], 0.0, 1.0, "t")
    assert [torque(curve, time=t) for t in (0.0, 0.25, 0.5, 1.0, 2.0)] == pytest.approx([0.0, 0.1, 0.2, 0.1, 0.1])
