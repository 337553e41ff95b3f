"""The library of effects: each acts as its equation says, and alike in both models."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ema_model.actuator import load_actuator, paths
from ema_model.commands import command
from ema_model.effects import CATALOGUE
from ema_model.effects.effect import FAMILIES, STAGES
from ema_model.effects.presliding_friction import EFFECT as PRESLIDING
from ema_model.effects.torsional_compliance import EFFECT as COMPLIANCE
from ema_model.physics.equations import advance_rotor
from ema_model.simulation.run import Run, simulate_monitor, simulate_reference

ACTUATOR = load_actuator()
GEAR = ACTUATOR.transmission.gear_ratio
HALF_PLAY_RAD = 0.5 * ACTUATOR.transmission.backlash_rad
MODELS = {"reference": simulate_reference, "monitor": simulate_monitor}
each_model = pytest.mark.parametrize("model", MODELS)
MOTION = ("motor_position_rad", "motor_speed_rad_s", "user_position_rad")

SINE = Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}), 0.5, load_torque_Nm=10.0)
LOADED_SINE = Run(SINE.command, 0.5, load_torque_Nm=20.0)
CHIRP = Run(command("chirp"), 0.5, load_torque_Nm=10.0)
SMALL_STEP = Run(command("step", {"final_rad": 5e-3}), 0.1)
# The load keeps the currents up, so that resistance and dead time matter at top speed too.
SATURATING = Run(command("step"), 0.25, load_torque_Nm=200.0)
FLIGHT = Run(command("step", {"final_rad": 1.0}), 0.15)  # at the current's limit, then at the top speed

# Where an effect shows, if not in the current during the sine.
SHOWN = {
    "acceleration_limit": (SATURATING, "motor_speed_rad_s"),
    "computation_delay": (FLIGHT, "motor_position_rad"),
    "current_loop_lag": (FLIGHT, "motor_position_rad"),
    "current_sensor_bias": (SINE, "motor_position_rad"),
    "dead_band": (SINE, "motor_position_rad"),
    "acceleration_feedforward": (SINE, "motor_position_rad"),
    "goal_delay": (SINE, "motor_position_rad"),
    "goal_gain": (SINE, "motor_position_rad"),
    "goal_rate_limit": (SINE, "motor_position_rad"),
    "velocity_feedforward": (SINE, "motor_position_rad"),
    "sampled_control": (SINE, "motor_position_rad"),
    "speed_filter": (SINE, "motor_position_rad"),
    "speed_loop_gain": (SINE, "motor_position_rad"),
    "speed_loop_integral": (SINE, "motor_position_rad"),
    "bus_voltage_sag": (SATURATING, "motor_speed_rad_s"),
    "dead_time": (SATURATING, "motor_speed_rad_s"),
    "encoder_eccentricity": (SINE, "motor_position_rad"),
    "position_sensor_eccentricity": (SINE, "motor_position_rad"),
    "position_sensor_gain": (SINE, "motor_position_rad"),
    "position_sensor_nonlinearity": (SINE, "motor_position_rad"),
    "resistance_drift": (SATURATING, "motor_speed_rad_s"),
    "winding_resistance": (SATURATING, "motor_speed_rad_s"),
    "gear_load_friction": (LOADED_SINE, "current_A"),
    "position_sensor_bias": (SINE, "motor_position_rad"),
    "position_sensor_delay": (CHIRP, "motor_position_rad"),
    "presliding_friction": (SMALL_STEP, "motor_position_rad"),
    "screw_lead_error": (SINE, "motor_position_rad"),
    "stribeck_friction": (CHIRP, "current_A"),
}
STRONGER = {
    "torque_ripple": 0.3,
    "torque_saturation": 0.02,
}  # than the strongest severity, to stand out of the inverter's chopping
# A phase's dead time in the Reference Model is this much in the Monitor Model's equivalent winding.
PHASE_TO_WINDING = {"dead_time": math.sqrt(2.0) * 4.0 / math.pi}


def settings(effect: str, severity: int, factor: float = 1.0) -> dict[str, dict[str, float]]:
    declared = CATALOGUE[effect]
    value = STRONGER.get(effect, declared.severities[severity])
    return {effect: {declared.parameters[0].name: factor * value}}


def block_means(values):
    """Means over 0.5 ms of a signal at 10 kHz; the start is left out."""
    whole = values[1:]
    return whole[: 5 * (len(whole) // 5)].reshape(-1, 5).mean(axis=1)


def rms(values) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


# --- declarations -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("effect", CATALOGUE)
def test_declaration_is_whole(effect):
    declared = CATALOGUE[effect]
    for text in (declared.title, declared.equation, declared.source, declared.shows, declared.mistaken_for):
        assert text.strip()
    assert len(declared.explanation) > 150
    for parameter in declared.parameters:
        assert parameter.low <= parameter.default <= parameter.high
    in_drive = [place for place in declared.places if place.__name__ in STAGES]
    assert bool(declared.states) == (declared.advance_states is not None or (bool(in_drive) and bool(declared.states)))
    assert declared.advance_states is None or not in_drive, "states are renewed in one way"
    assert declared.acts_in_drive == bool(in_drive) and declared.family in FAMILIES
    assert declared.family != "drive" or len(in_drive) == len(declared.places)
    assert not declared.duplicates or declared.duplicates in paths()


# The pendulum's default is that of a small servo, its severities are of the thesis's actuator.
@pytest.mark.parametrize("effect", [name for name in CATALOGUE if name != "pendulum_load"])
def test_default_is_the_middle_severity(effect):
    declared = CATALOGUE[effect]
    assert declared.parameters[0].default == declared.severities[1]


# --- both models ------------------------------------------------------------------------------------------------------


def neutral_at_zero() -> list[str]:
    """Effects whose first parameter may be 0 in the middle of its range (those that begin at 0: test_stacks)."""
    return [e.name for e in CATALOGUE.values() if e.parameters[0].low < 0.0 < e.parameters[0].high]


@each_model
@pytest.mark.parametrize("effect", neutral_at_zero())
def test_zero_changes_nothing(effect, model):
    run = Run(CHIRP.command, 0.15, load_torque_Nm=5.0)
    plain = MODELS[model](run, ACTUATOR)
    off = MODELS[model](run, ACTUATOR, effects={effect: {CATALOGUE[effect].parameters[0].name: 0.0}})
    for name in ("current_A", *MOTION):
        assert np.max(np.abs(off[name] - plain[name])) <= 1e-6 * np.max(np.abs(plain[name]))


@pytest.mark.parametrize("effect", CATALOGUE)
def test_both_models_show_the_same_change(effect):
    """What the effect changes in 0.5 ms means of the three-phase model, it changes in the equivalent one."""
    run, signal = SHOWN.get(effect, (SINE, "current_A"))
    changes = []
    for simulate, factor in ((simulate_reference, 1.0), (simulate_monitor, PHASE_TO_WINDING.get(effect, 1.0))):
        plain, with_effect = (
            simulate(run, ACTUATOR, effects=e) for e in ({}, settings(effect, severity=2, factor=factor))
        )
        changes.append(block_means(with_effect[signal]) - block_means(plain[signal]))
    three_phases, equivalent = changes
    assert rms(three_phases) > 0.0
    assert rms(three_phases - equivalent) <= 0.2 * rms(three_phases)


# --- sensors ----------------------------------------------------------------------------------------------------------


@each_model
def test_current_sensor_gain_changes_the_reading_alone(model):
    value = CATALOGUE["current_sensor_gain"].severities[2]
    # Nought of the effect in place of none: the same kernels, so that the motion is the same to the last bit.
    plain, seen = (
        MODELS[model](CHIRP, ACTUATOR, effects=settings("current_sensor_gain", 2, factor)) for factor in (0.0, 1.0)
    )
    for name in MOTION:
        np.testing.assert_array_equal(seen[name], plain[name])
    np.testing.assert_allclose(seen["current_A"][1:], plain["current_A"][1:] * (1.0 + value), atol=1e-9)


@each_model
def test_position_sensor_bias_moves_the_motor_and_not_the_reading(model):
    bias = CATALOGUE["position_sensor_bias"].severities[2]
    plain, seen = (MODELS[model](SINE, ACTUATOR, effects=e) for e in ({}, settings("position_sensor_bias", 2)))
    late = plain.time_s > 0.1
    shift = (seen["motor_position_rad"] - plain["motor_position_rad"])[late]
    assert np.median(shift) == pytest.approx(-bias / GEAR, rel=0.01)
    assert rms((seen["user_position_rad"] - plain["user_position_rad"])[late]) < 0.05 * bias


@each_model
@pytest.mark.parametrize("delay", CATALOGUE["position_sensor_delay"].severities)
def test_delay_trails_a_ramp_by_speed_times_delay(delay, model):
    slope = 0.05
    run = Run(command("ramp", {"slope_rad_s": slope}), 0.3)
    seen = MODELS[model](run, ACTUATOR, effects={"position_sensor_delay": {"delay_s": delay}})
    user = GEAR * seen["motor_position_rad"] - HALF_PLAY_RAD  # in positive motion
    trailing = (user - seen["user_position_rad"])[-500:]
    assert np.mean(trailing) == pytest.approx(slope * delay, rel=0.01)


# --- friction and the drive -------------------------------------------------------------------------------------------


def test_drag_grows_with_the_square_of_speed():
    """To the dry friction at ω_q, whatever the direction; nothing at rest, and nothing at all where ω_q is endless."""
    law = CATALOGUE["quadratic_drag"].places[0]

    def drag(omega, speed=400.0):
        return law(0.05, 0.1, omega, 0.0, 0.0, 0.0, 0.0, GEAR, 0.0, 0.0, 0.0, speed) - 0.05

    assert drag(400.0) == drag(-400.0) == pytest.approx(0.05) and drag(0.0) == 0.0
    assert drag(600.0) == pytest.approx(4.0 * drag(300.0)) and drag(800.0, np.inf) == 0.0


def test_drag_of_a_film_grows_with_its_power_of_speed():
    """To the dry friction at ω_p, whatever the direction; four times the speed takes twice the torque where p = 1/2."""
    law = CATALOGUE["power_law_drag"].places[0]

    def drag(omega, speed=400.0, exponent=0.5):
        return law(0.05, 0.1, omega, 0.0, 0.0, 0.0, 0.0, GEAR, 0.0, 0.0, 0.0, speed, exponent) - 0.05

    assert drag(400.0) == drag(-400.0) == pytest.approx(0.05) and drag(0.0) == 0.0
    assert drag(400.0) == pytest.approx(2.0 * drag(100.0)) and drag(800.0, np.inf) == 0.0
    assert drag(800.0, exponent=2.0 / 3.0) == pytest.approx(0.05 * 2.0 ** (2.0 / 3.0))


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_mesh_friction_is_of_what_the_motors_own_friction_leaves(direction):
    """It grows with J dω/dt + τ T_load alike whether the motor drives or brakes it; turning steadily adds nothing."""
    law, level, ratio, drag = CATALOGUE["mesh_friction"].places[0], 0.05, 0.2, 0.02

    def friction(motor_torque, omega):
        given = (0.1, omega, motor_torque, drag * np.sign(omega), 0.0, 0.0, GEAR, 0.0, 0.0, 0.0)
        return law(level, *given, ratio)

    for carried in (-0.4, 0.0, 0.4):
        resists = level + ratio * abs(carried)
        motor = direction * (carried + resists + drag)
        assert friction(motor, 3.0 * direction) == pytest.approx(resists)


def test_mesh_friction_holds_at_rest_what_it_takes_to_turn_that_way():
    """A motor that holds a load in part is turned back by it: the load's torque is carried against what holds."""
    law, level, ratio = CATALOGUE["mesh_friction"].places[0], 0.05, 0.2
    starts, still = (law(level, 0.1, omega, 0.3, 0.0, -0.4, 0.7, GEAR, 0.0, 0.0, 0.0, ratio) for omega in (-1e-9, 0.0))
    assert still == starts == pytest.approx((level + ratio * 0.3) / (1.0 - ratio))


def pushed_rotor(torque_Nm, seconds: float, stiffness: float, dt: float = 1e-5) -> tuple[float, float, float]:
    """Angle, speed and bristles' bend of the thesis's rotor after a torque (a function of time) against LuGre's law."""
    static, dynamic, inverse = 0.1013, 0.0507, 1.0 / 1.3e-5
    friction, advance = PRESLIDING.places[0], PRESLIDING.advance_states
    assert advance is not None
    theta, omega, bend = 0.0, 0.0, 0.0
    for step in range(round(seconds / dt)):
        active = torque_Nm(step * dt)
        resisting = friction(0.0, omega, active, static, dynamic, stiffness, 0.01, bend)
        theta1, omega1 = advance_rotor(theta, omega, active - resisting, inverse, False, -1e9, 1e9, dt)
        (bend,) = advance(
            dt, theta, omega, 0.0, 0.0, 0.0, GEAR, 0.0, active, static, dynamic, stiffness, 0.01, bend
        )  # fmt: skip
        theta, omega = theta1, omega1
    return theta, omega, bend


@pytest.mark.parametrize("stiffness", PRESLIDING.severities)
def test_presliding_sticks_below_and_slides_above_static_friction(stiffness):
    held = 0.07  # between dynamic and static friction
    theta, omega, bend = pushed_rotor(lambda t: held * min(1.0, t / 0.25), 0.3, stiffness)
    assert abs(omega) < 0.02
    assert stiffness * bend == pytest.approx(held, rel=0.02)
    assert theta < 3.0 * held / stiffness, "it creeps"
    slid, fast, _ = pushed_rotor(lambda t: 0.12 * min(1.0, t / 0.05), 0.1, stiffness)
    assert fast > 50.0 and slid > 1.0


def test_presliding_friction_of_steady_sliding_is_dynamic_friction():
    friction, advance = PRESLIDING.places[0], PRESLIDING.advance_states
    assert advance is not None
    for omega in (-300.0, 20.0, 800.0):
        bend = 0.0
        for _ in range(5000):
            (bend,) = advance(1e-5, 0.0, omega, 0.0, 0.0, 0.0, GEAR, 0.0, 0.0, 0.1, 0.05, 8.0, 0.01, bend)
        assert friction(0.0, omega, 0.0, 0.1, 0.05, 8.0, 0.01, bend) == pytest.approx(math.copysign(0.05, omega))


def test_asymmetric_friction_takes_its_share_each_way():
    sliding, viscous = CATALOGUE["asymmetric_friction"].places
    speeds, given = (3.0, -3.0), (0.2, 1e-3)
    found = [sliding(0.05, 0.1, omega, 0.0, 0.0, 0.0, 0.0, GEAR, 0.0, 0.0, 0.0, *given) for omega in speeds]
    assert found == pytest.approx([0.06, 0.04])
    found = [viscous(0.5, 0.0, omega, 0.0, 0.0, GEAR, 0.0, 0.0, *given) for omega in speeds]
    assert found == pytest.approx([0.497, 0.497]), "it brakes one way and helps the other, in proportion to speed"


def test_bus_voltage_never_turns_round():
    law = CATALOGUE["bus_voltage_sag"].places[0]
    assert law(48.0, -10.0, 6.0, 0.5) == pytest.approx(37.0)
    assert law(5.0, 1.0, 6.0, 0.0) == 0.0
    assert math.isnan(law(math.nan, 1.0, 6.0, 0.0))


@pytest.mark.parametrize("gain", [0.0, 0.05, 0.2])
def test_dead_time_costs_its_voltage_of_the_current_that_flows_with_it(gain):
    """I = I_0 − g V, V = V_dt sgn I but for a hundredth of the current at standstill: it never turns round."""
    law, lost, most = CATALOGUE["dead_time"].places[0], 1.0, 20.0
    alone = np.linspace(-2.0, 2.0, 401)  # A, without the loss
    against = np.array([law(3.0, 0.0, current, gain, most, lost) - 3.0 for current in alone])
    flows = alone - gain * against
    assert np.all(flows * alone >= 0.0) and np.all(np.diff(flows) > 0.0)
    assert against == pytest.approx(lost * np.clip(flows / (0.01 * most), -1.0, 1.0), abs=1e-9)


def test_dead_time_looks_like_resistance():
    """Both take voltage with the current's sign: where a load keeps that, they can hardly be told apart."""
    plain = simulate_monitor(SATURATING, ACTUATOR)["motor_speed_rad_s"]
    dead, resistance, inertia = (
        simulate_monitor(SATURATING, ACTUATOR, effects=settings(name, 2))["motor_speed_rad_s"] - plain
        for name in ("dead_time", "winding_resistance", "inertia_error")
    )

    def cosine(a, b) -> float:
        return float(a @ b / math.sqrt((a @ a) * (b @ b)))

    assert cosine(dead, resistance) > 0.97 > 0.5 > cosine(dead, inertia)


# --- transmission -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("stiffness", "mode_Hz"), list(zip(COMPLIANCE.severities, (90.0, 60.0, 30.0))))
def test_compliance_swings_at_its_mode_on_a_motor_that_is_held(stiffness, mode_Hz):
    advance = COMPLIANCE.advance_states
    assert advance is not None
    inertia = next(p.default for p in COMPLIANCE.parameters if p.name == "inertia_kgm2")
    dt, deflections = 1e-5, []
    states = (1e-3, 0.0, 0.0)
    for _ in range(20_000):
        states = advance(
            dt, 0.0, 0.0, 0.0, 0.0, 0.0, GEAR, 0.0, 0.0, 0.1, 0.05, stiffness, 0.01, inertia, *states
        )  # fmt: skip
        deflections.append(states[0])
    crossings = np.flatnonzero(np.diff(np.sign(deflections)))
    measured = 0.5 * (len(crossings) - 1) / ((crossings[-1] - crossings[0]) * dt)
    assert measured == pytest.approx(mode_Hz, rel=0.01)


@each_model
@pytest.mark.parametrize("severity", range(3))
def test_compliance_yields_to_the_load_and_hands_it_on(model, severity):
    """At rest the shaft is twisted by load/K, and the motor holds the load as through a rigid shaft."""
    load = 150.0  # more than friction holds
    run = Run(command("step", {"final_rad": 1e-3}), 0.4, load_torque_Nm=load)
    rigid, twisted = (MODELS[model](run, ACTUATOR, effects=e) for e in ({}, settings("torsional_compliance", severity)))
    stiffness = COMPLIANCE.severities[severity]
    at_rest = slice(-200, None)
    # Swinging may leave it at the other flank of the play.
    deflections = [(m["user_position_rad"] - GEAR * m["motor_position_rad"])[at_rest].mean() for m in (rigid, twisted)]
    assert deflections[1] - deflections[0] == pytest.approx(-load / stiffness, abs=2.1 * HALF_PLAY_RAD)
    assert load / stiffness > 20.0 * HALF_PLAY_RAD
    dry = ACTUATOR.motor.static_friction_Nm / ACTUATOR.motor.torque_constant_Nm_A
    currents = [m["current_A"][at_rest].mean() for m in (rigid, twisted)]
    assert abs(currents[1] - currents[0]) <= 2.0 * dry
    assert currents[1] == pytest.approx(GEAR * load / ACTUATOR.motor.torque_constant_Nm_A, abs=1.1 * dry)


@each_model
def test_screw_lead_error_repeats_with_its_period(model):
    amplitude, period = 2e-5, 4.0
    wobble = {"screw_lead_error": {"amplitude_rad": amplitude, "period_rad": period, "phase_rad": 0.7}}
    seen = MODELS[model](Run(command("ramp", {"slope_rad_s": 0.05}), 0.4), ACTUATOR, effects=wobble)
    theta, late = seen["motor_position_rad"], seen.time_s > 0.05
    off = seen["user_position_rad"] - (GEAR * theta - HALF_PLAY_RAD)
    expected = amplitude * np.sin(2.0 * np.pi * theta / period + 0.7)
    np.testing.assert_allclose(off[late], expected[late], atol=0.01 * amplitude)


@pytest.mark.parametrize("name", CATALOGUE)
def test_no_severity_is_one_that_no_such_part_has(name):
    strength = CATALOGUE[name].parameters[0]
    size = {"": 1.0, "current_A": ACTUATOR.controller.current_limit_A}[strength.plausible_at]
    if strength.plausible_of:
        size = 1.0 / ACTUATOR.value(strength.plausible_of)
    low, high = strength.plausible
    for value in CATALOGUE[name].severities:
        assert (low is None or low <= value * size) and (high is None or value * size <= high)
