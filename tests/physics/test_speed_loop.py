"""The speed loop's integral and derivative action: limits that must hold, in both models where there are two."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.signal import lsim

from ema_model.actuator import Actuator, Tolerance, load_actuator
from ema_model.actuator.parameters import Inverter
from ema_model.commands import Recorded, command
from ema_model.estimation import calibrate, floor
from ema_model.estimation.noise import as_it_is
from ema_model.faults import HEALTHY
from ema_model.models import ClosedLoop
from ema_model.recordings import Measurement
from ema_model.simulation.run import Run, simulate_monitor, simulate_reference

GAIN = 5.0  # N·m/rad
LOAD = 40.0  # N·m at the user
PI = {"controller.integral_gain_Nm_rad": GAIN, "controller.integrator_window_rad": 10.0}
NO_FRICTION = {
    "motor.static_friction_Nm": 0.0,
    "motor.dynamic_friction_Nm": 0.0,
    "motor.viscous_friction_Nms_rad": 0.0,
    "transmission.backlash_rad": 0.0,
}
THESIS = load_actuator()
FREE = THESIS.with_values(NO_FRICTION)
SMALL = command("step", {"final_rad": 1e-3, "time_s": 0.0})
SIGNALS = ("current_A", "motor_position_rad", "motor_speed_rad_s", "user_position_rad")
each_model = pytest.mark.parametrize("model", [simulate_reference, simulate_monitor], ids=["reference", "monitor"])


def with_current_drive(actuator: Actuator, **changes) -> Actuator:
    """The same cascade on an ideal current source: none of the thesis's PID's standstill."""
    return replace(actuator, inverter=Inverter("current", current_limit_A=22.5), **changes)


DRIVE = with_current_drive(FREE)


@each_model
def test_integral_removes_the_error_that_a_load_leaves(model):
    run = Run(SMALL, 0.3, load_torque_Nm=LOAD)
    missing = 1e-3 - np.array([model(run, FREE.with_values(v))["user_position_rad"][-1] for v in ({}, PI)])
    controller = FREE.controller
    left = FREE.transmission.gear_ratio * LOAD / (controller.position_gain_1_s * controller.speed_gain_Nms_rad)
    assert missing[0] == pytest.approx(left, rel=0.03)
    assert abs(missing[1]) < 0.01 * left


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_loop_is_the_linear_pid_where_nothing_is_limited(sign):
    derivative = 2e-6
    actuator = DRIVE.with_values(PI | {"controller.derivative_gain_Nms2_rad": derivative})
    run = Run(command("sine", {"amplitude_rad": sign * 1e-3, "frequency_Hz": 10.0}), 0.3, load_torque_Nm=sign * LOAD)
    seen = simulate_monitor(run, actuator)
    c, tau, inertia = actuator.controller, actuator.transmission.gear_ratio, actuator.motor.inertia_kgm2
    # (θ, ω, K_I ∫e dt) under (command, its rate, load); e = G (command − τθ) − ω, and de/dt holds dω/dt
    total = inertia + derivative
    kp, kd, g = c.speed_gain_Nms_rad, derivative, c.position_gain_1_s
    a = np.array(
        [
            [0.0, 1.0, 0.0],
            [-kp * g * tau / total, (-kp - kd * g * tau) / total, 1.0 / total],
            [-GAIN * g * tau, -GAIN, 0.0],
        ]
    )
    b = np.array([[0.0, 0.0, 0.0], [kp * g / total, kd * g / total, -tau / total], [GAIN * g, 0.0, 0.0]])
    time = np.arange(30_001) * 1e-5
    demand = run.command.at(time)
    inputs = np.stack([demand, np.gradient(demand, time), np.full_like(time, sign * LOAD)], axis=1)
    _, _, states = lsim((a, b, np.eye(3), np.zeros((3, 3))), inputs, time)
    for name, exact in (("motor_position_rad", states[::10, 0]), ("motor_speed_rad_s", states[::10, 1])):
        np.testing.assert_allclose(seen[name], exact, atol=5e-3 * np.max(np.abs(exact)), err_msg=name)


def test_smaller_steps_converge():
    actuator = DRIVE.with_values(PI)
    run = Run(command("sine", {"amplitude_rad": 1e-3, "frequency_Hz": 10.0}), 0.2, 5000.0, load_torque_Nm=LOAD)
    ends = [simulate_monitor(run, replace(actuator, step_s=step))["motor_speed_rad_s"] for step in (4e-5, 2e-5, 1e-5)]
    coarse, fine = (np.max(np.abs(a - b)) for a, b in pairwise(ends))
    assert fine == pytest.approx(0.5 * coarse, rel=0.1)  # first order


@each_model
def test_overshoot_after_a_long_saturation_is_bounded(model):
    """The speed is at its limit and the current too while the motor starts and brakes: 0.4 s of error."""
    actuator = FREE.with_values(PI | {"motor.inertia_kgm2": 2e-3})
    run = Run(command("step", {"final_rad": 0.1, "time_s": 0.0}), 1.0)
    user = model(run, actuator)["user_position_rad"]
    c = actuator.controller
    # What the integral can hold when the error turns is the limit's torque; it is gone once ∫e dt has undone it.
    most = actuator.transmission.gear_ratio * c.torque_constant_Nm_A * c.current_limit_A / GAIN
    proportional = model(run, actuator.with_values({"controller.integral_gain_Nm_rad": 0.0}))["user_position_rad"]
    assert np.max(user) - max(0.1, np.max(proportional)) < most
    assert user[-1] == pytest.approx(0.1, abs=1e-4)


@each_model
def test_changed_signs_change_the_answer_s_signs(model):
    actuator = THESIS.with_values(PI | {"controller.derivative_gain_Nms2_rad": 1e-7})
    one, other = (
        model(Run(command("step", {"final_rad": s * 5e-3, "time_s": 0.0}), 0.1, load_torque_Nm=s * LOAD), actuator)
        for s in (1.0, -1.0)
    )
    tolerance = 1e-9 if model is simulate_monitor else 0.02  # relays at ± at the start make the ripple another one
    for name in ("motor_position_rad", "user_position_rad"):
        np.testing.assert_allclose(one[name], -other[name], atol=tolerance * np.max(np.abs(one[name])), err_msg=name)


def test_a_stuck_motor_breaks_loose_when_the_integral_has_grown_to_the_static_friction():
    """At rest e is constant, so that T = K_P e + K_I e t; the thesis's own PID waits for ever (T 3.2.3)."""
    stuck = THESIS.with_values(PI | {"transmission.backlash_rad": 0.0})
    demand = 1e-5
    run = Run(Recorded(np.array([0.0, 1.0]), np.full(2, demand)), 0.1)
    error = stuck.controller.position_gain_1_s * demand
    loose = (stuck.motor.static_friction_Nm - stuck.controller.speed_gain_Nms_rad * error) / (GAIN * error)
    assert 0.005 < loose < 0.05
    moved = simulate_monitor(run, with_current_drive(stuck), start_rad=0.0)
    assert moved.time_s[np.argmax(moved["motor_speed_rad_s"] > 0.0)] == pytest.approx(loose, abs=2e-4)
    for model in (simulate_monitor, simulate_reference):
        assert np.max(np.abs(model(run, stuck, start_rad=0.0)["user_position_rad"])) < 0.1 * demand


def test_a_drive_that_is_switched_off_forgets():
    actuator = DRIVE.with_values(PI)
    time = np.arange(0.0, 0.2, 1e-4)
    enabled = np.where((time > 0.05) & (time < 0.1), 0.0, 1.0)
    held = {"time_s": time, "command_rad": np.full_like(time, 1e-3), "user_position_rad": np.full_like(time, 1e-3)}
    load = {"load_torque_Nm": np.where(time < 0.05, LOAD, 0.0)}
    plant = ClosedLoop([Measurement({**held, **load, "drive_enabled": enabled})], actuator)
    [window] = plant.windows
    torque = plant.signals(0)["current_A"][0] * actuator.motor.torque_constant_Nm_A
    at = window.time_s
    carried = actuator.transmission.gear_ratio * LOAD
    assert torque[at < 0.05][-1] == pytest.approx(carried, rel=0.02)
    assert np.all(torque[(at > 0.051) & (at < 0.099)] == 0.0)
    # it moved a little meanwhile, but not with the load's torque again
    assert np.abs(torque[(at > 0.101)]).max() < 0.5 * carried


def recorded(actuator: Actuator, seconds: float = 0.3) -> Measurement:
    chirp = Run(command("chirp"), seconds, load_torque_Nm=LOAD)
    model = simulate_reference if actuator.has_reference_model else simulate_monitor
    return model(chirp, actuator)


@pytest.mark.parametrize("first", [600, 1500, 2100])
def test_a_stretch_from_the_middle_goes_on_as_the_whole_did(first, monkeypatch):
    actuator = with_current_drive(THESIS).with_values(PI)
    plant = ClosedLoop([recorded(actuator)], actuator, stretches=[[slice(first, first + 800)]])
    [window] = plant.windows

    def errors():
        shown = plant.signals(0)
        return np.array([np.sqrt(np.mean((shown[s][0] - window.measured[s]) ** 2)) for s in SIGNALS])

    balanced = errors()
    monkeypatch.setattr(type(window), "integral_Nm", lambda *_: 0.0)
    assert np.all(balanced < 0.2 * errors()), "an integral that starts at 0 must be told from one that goes on"


FOLLOWED = {
    "velocity_feedforward": {"ratio": 0.7},
    "goal_rate_limit": {"rate_rad_s": 0.1},
    "goal_delay": {"delay_s": 0.02},
}


@pytest.mark.parametrize("effect", FOLLOWED)
@pytest.mark.parametrize("three_phase", [False, True], ids=["monitor model", "reference model"])
def test_a_drive_that_is_caught_in_mid_run_has_followed_its_command_before(effect, three_phase):
    """What it makes of its goal goes on, and the integral is what makes this drive ask for the current that flows."""
    actuator = THESIS.with_values(PI) if three_phase else with_current_drive(THESIS).with_values(PI)
    actuator = replace(actuator, effects={effect: FOLLOWED[effect]})
    moves = Run(command("sine", {"amplitude_rad": 0.01, "frequency_Hz": 3.0}), 0.3)
    model = simulate_reference if three_phase else simulate_monitor
    seen = model(moves, actuator, effects=actuator.effects)
    plant = ClosedLoop([seen], actuator, stretches=[[slice(1500, 2300)]])
    [window] = plant.windows

    def apart():
        shown = as_it_is(plant.twins(0, actuator, np.atleast_2d(actuator.k)) if three_phase else plant.signals(0))
        return [np.sqrt(np.mean((shown[s] - window.measured[s]) ** 2)) for s in ("motor_position_rad", "current_A")]

    followed = np.array(apart())
    plant.windows[0] = replace(window, before=window.before[:0])
    assert np.all(followed < 0.03 * np.array(apart()))


def test_a_start_in_mid_run_is_bumpless_for_every_lane(monkeypatch):
    """The first current that each wants is about the one measured, whatever its gains are."""
    actuator = DRIVE.with_values(PI)
    plant = ClosedLoop([recorded(actuator)], actuator, block_s=0.0, stretches=[[slice(1500, 2500)]])
    [window] = plant.windows
    gains = np.array([2.0, 5.0, 8.0])
    varied = actuator.varied({"controller.integral_gain_Nm_rad": gains, "controller.speed_gain_Nms_rad": 0.01 * gains})
    k = np.tile(HEALTHY, (3, 1))
    k[:, 7] = [0.3, 0.5, 0.9]
    np.testing.assert_allclose(plant.signals(0, varied, k)["current_A"][:, 0], window.current_A, rtol=0.15)
    proportional = actuator.varied({"controller.integral_gain_Nm_rad": np.zeros(3)})
    shown = plant.signals(0, proportional, k)["current_A"][:, 0]
    monkeypatch.setattr(type(window), "integral_Nm", lambda *_: 0.0)
    np.testing.assert_array_equal(plant.signals(0, proportional, k)["current_A"][:, 0], shown)


def test_what_the_drive_asked_for_at_a_start_is_fitted():
    """A noisy current tells it to a few percent, and what that is off by would stand in the position for long."""
    actuator = DRIVE.with_values(PI)
    noisy = {"current_A": 0.5, "motor_position_rad": 1e-4, "user_position_rad": 1e-7}
    random = np.random.default_rng(5)
    later = command("step", {"final_rad": 1e-3, "time_s": 0.25})
    held = simulate_monitor(Run(later, 0.4, load_torque_Nm=LOAD), actuator).signals
    whole = {name: values[2000:] for name, values in held.items()}  # it stands, and its integral holds the load
    seen = {name: values + noisy.get(name, 0.0) * random.standard_normal(len(values)) for name, values in whole.items()}
    del seen["motor_speed_rad_s"]
    plant = ClosedLoop([Measurement(seen)], actuator)
    found = calibrate(plant, [floor(plant, 0)], free=())
    asked = DRIVE.controller.torque_constant_Nm_A * (whole["current_A"][0] - plant.windows[0].current_A)
    assert found.chi2_per_value < 1.1 and found.starts["pull 0"].value == pytest.approx(asked, abs=5e-3)
    measured = plant.windows[0].measured["motor_position_rad"]
    fitted, taken = (np.std(one["motor_position_rad"] - measured) for one in (found.signals[0], plant.signals(0)))
    assert fitted < 0.3 * taken


def test_without_a_measured_current_a_stretch_begins_in_balance():
    actuator = with_current_drive(THESIS).with_values(PI)
    whole = recorded(actuator).signals
    seen = Measurement({name: values for name, values in whole.items() if name != "current_A"})
    window = ClosedLoop([seen], actuator, stretches=[[slice(1500, 2500)]]).windows[0]
    motor = actuator.motor
    assert whole["motor_speed_rad_s"][1500] < -1.0
    torque = actuator.transmission.gear_ratio * LOAD - motor.dynamic_friction_Nm
    assert motor.torque_constant_Nm_A * window.current_A == pytest.approx(torque, rel=0.02)


@pytest.mark.parametrize("truth", [3.0, 6.0])
def test_calibration_recovers_the_integral_gain_of_a_reference_model(truth):
    path = "controller.integral_gain_Nm_rad"
    recording = recorded(THESIS.with_values(PI | {path: truth}), 0.4)
    nominal = replace(THESIS.with_values(PI | {path: 4.5}), tolerances={path: Tolerance(1.0, True)})
    plant = ClosedLoop([recording], nominal)
    found = calibrate(plant, [floor(plant, 0)]).parameters[path]
    assert found.value == pytest.approx(truth, rel=0.05)
    assert found.interval90[0] - 0.1 < truth < found.interval90[1] + 0.1


@pytest.mark.parametrize("first", [0, 1500], ids=["at rest", "in mid motion"])
def test_a_recording_may_begin_in_mid_motion(first):
    """Its first samples say how fast it moves; one that begins at rest begins at 0, however fast it is soon."""
    whole = simulate_monitor(Run(command("chirp"), 0.3), DRIVE).signals
    seen = {name: values[first:] for name, values in whole.items() if name != "motor_speed_rad_s"}
    [window] = ClosedLoop([Measurement(seen)], DRIVE).windows
    assert window.speed_rad_s == pytest.approx(whole["motor_speed_rad_s"][first], rel=0.05, abs=1e-9)
    assert (first == 0) == (window.speed_rad_s == 0.0)


@pytest.mark.parametrize("rate_Hz", [500.0, 1_000.0, 10_000.0])
def test_a_slow_log_that_begins_at_rest_begins_at_rest(rate_Hz):
    """A sine that a drive jumps after: at 500 Hz it is as fast as it will be within ten samples."""
    moves = Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}), 0.3, sample_rate_Hz=rate_Hz)
    [window] = ClosedLoop([simulate_reference(moves, THESIS)], THESIS).windows
    assert window.speed_rad_s == 0.0
