"""Limits and elements: stick, play, end stops, step size, and the elementary functions."""

from __future__ import annotations

import math
from itertools import pairwise

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ema_model.actuator import load_actuator
from ema_model.commands import Recorded, command
from ema_model.errors import InputError
from ema_model.faults import vector
from ema_model.physics import elementary
from ema_model.physics.equations import (
    advance_play,
    advance_reversing_rotor,
    advance_rotor,
    air_gap,
    borello_friction,
    equivalent_current,
    flux_factor,
    flux_harmonics,
    minus_120,
    plus_120,
    winding_coefficients,
)
from ema_model.simulation.run import Run, simulate_monitor, simulate_reference

ACTUATOR = load_actuator()
TAU = ACTUATOR.transmission.gear_ratio
MODELS = {"reference": simulate_reference, "monitor": simulate_monitor}
each_model = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
HOLD = command("step", {"initial_rad": 0.0, "final_rad": 0.0})


# --- stick ------------------------------------------------------------------------------------------------------------


@each_model
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_rotor_sticks_below_static_friction_and_moves_above(model, sign):
    """At a constant command the current is nought at rest, so friction alone carries the load's torque τ·T."""
    breakaway = ACTUATOR.motor.static_friction_Nm / TAU
    stuck = model(Run(HOLD, 0.05, load_torque_Nm=sign * 0.98 * breakaway), ACTUATOR)
    assert np.all(stuck["motor_position_rad"] == 0.0) and np.all(stuck["motor_speed_rad_s"] == 0.0)
    moved = model(Run(HOLD, 0.05, load_torque_Nm=sign * 1.3 * breakaway), ACTUATOR)
    assert -sign * moved["motor_position_rad"][-1] > 1e-3
    # A fault of friction holds the load that moved it.
    held = model(Run(HOLD, 0.05, load_torque_Nm=sign * 1.3 * breakaway), ACTUATOR, vector({"k1": 0.5}))
    assert np.all(held["motor_position_rad"] == 0.0)


@each_model
@pytest.mark.parametrize(
    "effect",
    [
        {"gear_load_friction": {"ratio": 0.9}},
        {"mesh_friction": {"ratio": 0.6}},
        {"stribeck_friction": {"speed_rad_s": 10.0, "breakaway_ratio": 2.0}},
    ],
)
def test_a_rotor_that_an_effects_friction_holds_does_not_creep(model, effect):
    """A load of half as much again as the file's static friction, of which the effect holds 1.9 times and more."""
    level = ACTUATOR.value("motor.dynamic_friction_Nm")
    actuator = ACTUATOR.with_values({"motor.static_friction_Nm": level})
    pulled = Run(HOLD, 0.05, load_torque_Nm=1.5 * level / actuator.transmission.gear_ratio)
    assert np.ptp(model(pulled, actuator, effects=effect)["motor_position_rad"]) == 0.0
    assert np.ptp(model(pulled, actuator)["motor_position_rad"]) > 1e-3, "alone it gives way"


def test_borello_friction_balances_at_rest_and_opposes_motion():
    static, dynamic = 0.1, 0.05
    assert borello_friction(0.0, 0.08, static, dynamic) == 0.08
    assert borello_friction(0.0, -0.3, static, dynamic) == -static
    assert borello_friction(1e-9, 0.08, static, dynamic) == dynamic
    assert borello_friction(-1e-9, 0.08, static, dynamic) == -dynamic
    assert borello_friction(0.0, 0.18, static, 0.2) == 0.18, "what an effect adds in motion holds at rest, too"


def test_reversal_within_a_step_stops_the_rotor():
    _, omega = advance_rotor(0.0, 1e-3, -1.0, 1.0 / 1.3e-5, True, -1.0, 1.0, 1e-5)
    assert omega == 0.0
    theta, omega = advance_rotor(0.0, 1.0, 0.0, 1.0 / 1.3e-5, True, -1.0, 1.0, 1e-5)
    assert omega == 1.0 and theta == pytest.approx(1e-5)


@pytest.mark.parametrize("early", [False, True], ids=["at the end of a step", "at the beginning of the next"])
def test_a_reversal_is_when_the_speed_is_zero(early):
    """A rotor under a constant torque and Coulomb friction: the speed some steps after it, wherever the steps end."""
    inverse, level, pushed, dt = 1.0 / 1.3e-5, 0.05, -0.2, 1e-5

    def speed_after(start, steps):
        theta, omega, left = 0.0, start, 0.0
        for _ in range(steps):
            net = pushed - borello_friction(omega, pushed, level, level)
            theta, omega, left = advance_reversing_rotor(theta, omega, net, inverse, True, -9.0, 9.0, left, dt)
        return omega

    braking, away = (pushed - level) * inverse, (pushed + level) * inverse
    start = -braking * dt * (3.0 + (1e-6 if early else -1e-6))  # at rest after three steps, and a millionth of one
    assert speed_after(start, 8) == pytest.approx(away * (8 * dt + start / braking), rel=1e-9)


# --- play -------------------------------------------------------------------------------------------------------------


@each_model
@pytest.mark.parametrize("k2", [0.0, 0.5])
def test_user_waits_until_the_motor_has_crossed_the_play(model, k2):
    run = Run(command("sine", {"amplitude_rad": 5e-3, "frequency_Hz": 5.0}), 0.35, 50_000.0)
    s = model(run, ACTUATOR, vector({"k2": k2}))
    motor, user = s["motor_position_rad"], s["user_position_rad"] / TAU
    half = 0.5 * ACTUATOR.transmission.backlash_rad * (1.0 + 99.0 * k2) / TAU
    gap = motor - user
    assert np.max(np.abs(gap)) == pytest.approx(half, rel=1e-6)
    assert np.min(gap) == pytest.approx(-np.max(gap), rel=1e-6), "both flanks must be reached"
    # The user moves only where a flank pushes it, in the flank's direction.
    step = np.diff(user)
    moves = np.abs(step) > 1e-12
    assert np.any(step > 1e-12) and np.any(step < -1e-12)
    np.testing.assert_allclose(gap[1:][moves], half * np.sign(step[moves]), rtol=1e-6)
    # Between the motor's turn and the user's next move the motor crosses the whole play.
    signs = np.sign(step[moves])
    where = np.flatnonzero(moves)
    turns = np.flatnonzero(np.diff(signs))
    assert turns.size >= 2
    for turn in turns:
        before, after = where[turn] + 1, where[turn + 1]  # user's last sample before, and first after, the crossing
        assert abs(motor[after + 1] - motor[before]) >= 2.0 * half * (1.0 - 1e-9)


@given(
    st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=50),
    st.floats(0.0, 0.5),
)
def test_play_operator(inputs, half):
    play = 0.0
    for x in inputs:
        after = advance_play(play, x, half)
        assert x - half <= after <= x + half
        assert after == play or min(abs(after - (x - half)), abs(after - (x + half))) == 0.0
        assert advance_play(after, x, half) == after
        play = after


# --- end stops --------------------------------------------------------------------------------------------------------


@each_model
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_end_stop_holds_and_stops(model, sign):
    actuator = ACTUATOR.with_values({"transmission.stop_low_rad": -0.02, "transmission.stop_high_rad": 0.02})
    s = model(Run(command("step", {"final_rad": 0.5 * sign, "time_s": 1e-3}), 0.15), actuator)
    stop = 0.02 / TAU
    assert np.max(np.abs(s["motor_position_rad"])) == pytest.approx(stop, abs=1e-12)
    at = int(np.argmax(np.abs(s["motor_position_rad"]) >= stop - 1e-12))
    assert 0 < at < s.samples - 100
    assert np.max(np.abs(s["motor_speed_rad_s"][:at])) > 100.0
    assert np.all(s["motor_speed_rad_s"][at:] == 0.0)
    assert np.all(np.abs(s["motor_position_rad"][at:] - sign * stop) < 1e-12)
    # It can leave the stop again.
    back = Recorded(np.array([0.0, 0.05, 0.051, 0.15]), np.array([0.5, 0.5, 0.0, 0.0]) * sign)
    s = model(Run(back, 0.15), actuator, start_rad=0.0)
    assert np.max(np.abs(s["motor_position_rad"])) == pytest.approx(stop, abs=1e-12)
    assert abs(s["user_position_rad"][-1]) < 2e-4


# --- limits of the controller and the motor ---------------------------------------------------------------------------


def test_current_and_speed_limits_hold():
    step = Run(command("step"), 0.25, 100_000.0)
    monitor = simulate_monitor(step, ACTUATOR)
    assert np.max(np.abs(monitor["current_A"])) <= ACTUATOR.controller.current_limit_A * (1.0 + 1e-9)
    assert np.max(np.abs(monitor["current_A"])) > 0.99 * ACTUATOR.controller.current_limit_A
    slow = ACTUATOR.with_values({"controller.speed_limit_rad_s": 100.0})
    for model in MODELS.values():
        assert np.max(model(step, slow)["motor_speed_rad_s"]) == pytest.approx(100.0, rel=0.02)


# --- step size --------------------------------------------------------------------------------------------------------


def test_smaller_steps_converge():
    """With half the step the answer moves less and less."""
    run = command("sine", {"amplitude_rad": 5e-3, "frequency_Hz": 10.0})
    for model, rates in ((simulate_monitor, (100e3, 200e3, 400e3, 800e3)), (simulate_reference, (100e3, 200e3, 400e3))):
        motion = []
        for rate in rates:
            s = model(Run(run, 0.1, rate), ACTUATOR)
            motion.append(s["motor_position_rad"][:: round(rate / 10e3)])
        changes = [np.sqrt(np.mean((b - a) ** 2)) for a, b in pairwise(motion)]
        assert changes[0] < 2e-3 * np.max(np.abs(motion[-1])), "the default step is already fine"
        assert changes[-1] < 0.7 * changes[0], (model.__name__, changes)


# --- elementary functions ---------------------------------------------------------------------------------------------


@numba.njit
def _sine(x, out):
    for i in range(len(x)):
        out[i] = elementary.sine(x[i])


@numba.njit
def _decay(x, out):
    for i in range(len(x)):
        out[i] = elementary.decay(x[i])


def applied(f, x):
    out = np.empty_like(x)
    f(x, out)
    return out


def test_sine_and_decay_on_a_grid():
    for span in (math.pi, 100.0, 99_999.0):
        x = np.linspace(-span, span, 200_001)
        assert np.max(np.abs(applied(_sine, x) - np.sin(x))) <= 1e-6, span
    x = np.concatenate([np.linspace(0.0, 50.0, 200_001), [100.0, 1e3, 1e9]])
    assert np.max(np.abs(applied(_decay, x) - np.exp(-x))) <= 1.2e-8


def test_decay_keeps_its_documented_accuracy():
    x = np.linspace(0.0, 40.0, 200_001)
    assert np.max(np.abs(applied(_decay, x) - np.exp(-x))) <= 2e-8


@given(st.floats(-1e5, 1e5, exclude_min=True, exclude_max=True))
def test_sine(x):
    assert abs(elementary.sine(x) - math.sin(x)) <= 1e-6


@given(st.floats(0.0, 1e12))
def test_decay(x):
    assert abs(elementary.decay(x) - math.exp(-x)) <= 1.2e-8


@given(st.floats(-math.pi, math.pi), st.floats(-0.1, 0.1))
def test_rotate(angle, turn):
    s, c = elementary.rotate(math.sin(angle), math.cos(angle), turn)
    assert abs(s - math.sin(angle + turn)) <= 2e-11 * (1.0 + 1e-3)
    assert abs(c - math.cos(angle + turn)) <= 2e-11 * (1.0 + 1e-3)


@numba.njit
def _spin(turn, times):
    s, c = 0.0, 1.0
    for _ in range(times):
        s, c = elementary.rotate(s, c, turn)
    return s, c


@pytest.mark.parametrize("turn", [1e-4, -6e-3, 2.5e-2])
def test_rotate_does_not_drift(turn):
    """A million steps of at most 837 rad/s · 10 µs · 2 pole pairs · 2 keep the norm and the angle."""
    s, c = _spin(turn, 1_000_000)
    assert abs(math.hypot(s, c) - 1.0) < 1e-9
    angle = math.remainder(turn * 1_000_000, 2.0 * math.pi)
    assert abs(math.remainder(math.atan2(s, c) - angle, 2.0 * math.pi)) < 1e-4


@given(st.floats(allow_nan=False, allow_infinity=False), st.floats(-1e6, 1e6), st.floats(0.0, 1e6))
def test_clamp(x, low, width):
    high = low + width
    assert elementary.clamp(x, low, high) == np.clip(x, low, high)


def test_clamp_and_sign_of_odd_values():
    assert math.isnan(elementary.clamp(math.nan, -1.0, 1.0))
    assert elementary.clamp(math.inf, -1.0, 1.0) == 1.0
    assert [elementary.sign(x) for x in (-2.0, -0.0, 0.0, 3.0)] == [-1.0, 0.0, 0.0, 1.0]


# --- phases -----------------------------------------------------------------------------------------------------------

unit = st.floats(0.0, 1.0)
angle = st.floats(-math.pi, math.pi)


@given(st.tuples(unit, unit, unit), unit, angle, angle, st.integers(1, 4), angle)
def test_flux_factor_is_the_direct_sum(turns, eccentricity, phase, theta, pole_pairs, offset):
    shift = 2.0 * np.pi / 3.0 * np.arange(3)
    rotor = theta + offset
    electrical = pole_pairs * rotor
    gap = 1.0 + eccentricity * np.cos(rotor - phase + shift)
    direct = 2.0 / 3.0 * np.sum(np.array(turns) * np.sin(electrical - shift) ** 2 * gap)
    harmonics = flux_harmonics(np.array(turns), np.float64(eccentricity), np.float64(phase))
    f = flux_factor(
        math.sin(rotor), math.cos(rotor), math.sin(2.0 * electrical), math.cos(2.0 * electrical), tuple(harmonics)
    )
    assert f == pytest.approx(direct, abs=1e-12)


def test_flux_harmonics_of_a_population():
    random = np.random.default_rng(0)
    turns, zeta, phase = random.random((3, 7)), random.random(7), random.uniform(-3.0, 3.0, 7)
    together = flux_harmonics(turns, zeta, phase)
    assert together.shape == (9, 7)
    for i in range(7):
        np.testing.assert_allclose(together[:, i], flux_harmonics(turns[:, i], zeta[i], phase[i]), atol=1e-15)
    healthy = flux_harmonics(np.ones(3), np.float64(0.0), np.float64(0.3))
    np.testing.assert_allclose(healthy, [1.0, 0, 0, 0, 0, 0, 0, 0, 0], atol=1e-15)


@given(angle, angle, unit, angle, st.tuples(unit, unit, unit))
def test_windings_follow_their_formula(theta_e, theta, eccentricity, phase, turns):
    s, c = math.sin(theta_e), math.cos(theta_e)
    assert minus_120(s, c) == pytest.approx(
        (math.sin(theta_e - 2 * math.pi / 3), math.cos(theta_e - 2 * math.pi / 3)), abs=1e-12
    )
    assert plus_120(s, c) == pytest.approx(
        (math.sin(theta_e + 2 * math.pi / 3), math.cos(theta_e + 2 * math.pi / 3)), abs=1e-12
    )
    gaps = air_gap(math.sin(theta), math.cos(theta), eccentricity, math.cos(phase), math.sin(phase))
    k = winding_coefficients(s, c, *gaps, *turns)
    for i in range(3):
        gap = 1.0 + eccentricity * math.cos(theta - phase + 2.0 * math.pi * i / 3)
        assert gaps[i] == pytest.approx(gap, abs=1e-12)
        assert k[i] == pytest.approx(-turns[i] * math.sin(theta_e - 2.0 * math.pi * i / 3) * gap, abs=1e-12)


@given(angle, st.floats(-30.0, 30.0))
def test_equivalent_current_returns_the_reference(theta_e, reference):
    """Phase references −(2/3) I sin(θ_e − 2πi/3) give back I."""
    phases = [-2.0 / 3.0 * reference * math.sin(theta_e - 2.0 * math.pi * i / 3) for i in range(3)]
    assert equivalent_current(*phases, math.sin(theta_e), math.cos(theta_e)) == pytest.approx(reference, abs=1e-10)


@each_model
@pytest.mark.parametrize("start", [2.0, -3.0])
def test_start_beyond_the_end_stops_is_refused_or_held(model, start):
    run = Run(command("step", {"initial_rad": start, "final_rad": 1.0}), 0.1)
    try:
        s = model(run, ACTUATOR, vector({"k3": 0.3}))
    except InputError:
        return
    assert np.max(np.abs(s["user_position_rad"])) <= 1.5 * (1.0 + 1e-5)
    assert np.max(np.abs(s["current_A"])) <= 2.0 * ACTUATOR.controller.current_limit_A
