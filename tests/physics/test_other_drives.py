"""Other controllers, drives and loads in the same kernels: limits that must hold."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from ema_model.actuator import Actuator, load_actuator
from ema_model.commands import Recorded
from ema_model.errors import InputError
from ema_model.models import ClosedLoop
from ema_model.recordings import Measurement
from ema_model.simulation.run import Run, simulate_monitor, simulate_reference

SERVO = """
name = "servo"
[model]
step_s = {step}
[controller]
kind = "position"
gain_1_rad = {gain}
[inverter]
kind = "{drive}"
{full}
[motor]
torque_constant_Nm_A = 0.5
{winding}
inertia_kgm2 = 0.01
viscous_friction_Nms_rad = {viscous}
static_friction_Nm = 0.0
dynamic_friction_Nm = {friction}
[sensors]
"""


def servo(tmp_path, extra: str = "", **changes) -> Actuator:
    given = {
        "step": 1e-4,
        "gain": 1e6,
        "drive": "voltage",
        "full": "bus_voltage_V = 12.0",
        "winding": "resistance_Ohm = 4.0",
        "viscous": 0.0,
        "friction": 0.0,
    }
    path = tmp_path / "servo.toml"
    path.write_text(SERVO.format(**(given | changes)) + extra, encoding="utf-8")
    return load_actuator(path)


def held(value: float, seconds: float) -> Recorded:
    return Recorded(np.array([0.0, seconds]), np.array([value, value]))


def run_of(command, seconds: float) -> Run:
    return Run(command, seconds, 1000.0)


@pytest.mark.long
def test_voltage_drive_reaches_the_no_load_speed_in_its_time_constant(tmp_path):
    actuator = servo(tmp_path)
    run = simulate_monitor(run_of(held(1e6, 2.0), 2.0), actuator, start_rad=0.0)
    speed, time = run["motor_speed_rad_s"], run.time_s
    fastest = 12.0 / 0.5
    constant = 0.01 * 4.0 / 0.5**2  # J R / k²
    np.testing.assert_allclose(speed, fastest * (1.0 - np.exp(-time / constant)), atol=2e-3 * fastest)
    np.testing.assert_allclose(run["current_A"][5], 12.0 / 4.0, rtol=0.05)  # stalled at first


def test_viscous_drag_lowers_it(tmp_path):
    run = simulate_monitor(run_of(held(1e6, 4.0), 4.0), servo(tmp_path, viscous=0.05), start_rad=0.0)
    # V = R i + k ω and k i = C ω
    assert run["motor_speed_rad_s"][-1] == pytest.approx(12.0 / (0.5 + 4.0 * 0.05 / 0.5), rel=1e-3)


def test_ideal_current_accelerates_evenly(tmp_path):
    actuator = servo(tmp_path, drive="current", full="current_limit_A = 2.0", winding="")
    run = simulate_monitor(run_of(held(1e6, 0.5), 0.5), actuator, start_rad=0.0)
    np.testing.assert_array_equal(run["current_A"][1:], 2.0)
    np.testing.assert_allclose(run["motor_speed_rad_s"], 0.5 * 2.0 / 0.01 * run.time_s, rtol=1e-9, atol=1e-9)


def test_position_loop_settles_on_its_command_and_is_linear_within_the_limit(tmp_path):
    actuator = servo(tmp_path, gain=2.0, viscous=0.02)
    one, two = (simulate_monitor(run_of(held(x, 3.0), 3.0), actuator, start_rad=0.0) for x in (0.1, 0.2))
    assert one["user_position_rad"][-1] == pytest.approx(0.1, abs=1e-4)
    np.testing.assert_allclose(two["user_position_rad"], 2.0 * one["user_position_rad"], atol=1e-9)


def test_output_limit_cuts_the_voltage(tmp_path):
    half = replace(servo(tmp_path), controller=replace(servo(tmp_path).controller, output_limit=0.5))
    run = simulate_monitor(run_of(held(1e6, 2.0), 2.0), half, start_rad=0.0)
    assert run["motor_speed_rad_s"][-1] == pytest.approx(0.5 * 12.0 / 0.5, rel=1e-3)


PENDULUM = "[effects.pendulum_load]\nmoment_Nm = 0.2\n"


def let_go(actuator: Actuator, angle: float, seconds: float, enabled: float) -> dict[str, np.ndarray]:
    time = np.arange(0.0, seconds, 2e-3)
    recording = Measurement(
        {
            "time_s": time,
            "command_rad": np.zeros_like(time),
            "user_position_rad": np.full_like(time, angle),
            "drive_enabled": np.full_like(time, enabled),
        }
    )
    plant = ClosedLoop([recording], actuator)
    [window] = plant.windows
    return {name: values[0] for name, values in plant.signals(0).items()} | {"time_s": window.time_s}


def test_pendulum_swings_with_its_period_and_keeps_its_energy_when_the_drive_is_off(tmp_path):
    actuator = servo(tmp_path, PENDULUM)
    run = let_go(actuator, 0.05, 6.0, enabled=0.0)
    angle, speed, time = run["user_position_rad"], run["motor_speed_rad_s"], run["time_s"]
    crossings = time[1:][(angle[1:] > 0.0) != (angle[:-1] > 0.0)]
    period = 2.0 * float(np.mean(np.diff(crossings)))
    assert period == pytest.approx(2.0 * math.pi * math.sqrt(0.01 / 0.2), rel=2e-3)
    energy = 0.5 * 0.01 * speed**2 + 0.2 * (1.0 - np.cos(angle))
    np.testing.assert_allclose(energy, energy[0], rtol=0.03)
    assert np.all(run["current_A"] == 0.0)


def test_enabled_drive_brakes_it(tmp_path):
    actuator = servo(tmp_path, PENDULUM, gain=2.0)
    assert np.abs(let_go(actuator, 0.05, 6.0, 1.0)["motor_speed_rad_s"][-100:]).max() < 0.05


def test_constant_load_is_what_a_recorded_load_is(tmp_path):
    command = held(0.3, 1.0)
    by_effect = simulate_monitor(
        run_of(command, 1.0), servo(tmp_path, "[effects.constant_load]\ntorque_Nm = 0.4\n", gain=2.0), start_rad=0.0
    )
    by_load = simulate_monitor(
        replace(run_of(command, 1.0), load_torque_Nm=0.4), servo(tmp_path, gain=2.0), start_rad=0.0
    )
    np.testing.assert_allclose(by_effect["user_position_rad"], by_load["user_position_rad"], atol=1e-12)


def test_bus_voltage_scales_the_drive(tmp_path):
    actuator = servo(tmp_path)
    time = np.arange(0.0, 2.0, 2e-3)
    speeds = []
    for volts in (12.0, 6.0):
        recording = Measurement(
            {
                "time_s": time,
                "command_rad": np.full_like(time, 1e6),
                "motor_speed_rad_s": np.zeros_like(time),
                "user_position_rad": np.zeros_like(time),
                "bus_voltage_V": np.full_like(time, volts),
            }
        )
        plant = ClosedLoop([recording], actuator)
        speeds.append(plant.signals(0)["motor_speed_rad_s"][0, -1])
    assert speeds[0] == pytest.approx(2.0 * speeds[1], rel=1e-6) and speeds[0] == pytest.approx(24.0, rel=1e-3)


def test_reference_model_is_refused_for_another_drive(tmp_path):
    with pytest.raises(InputError, match="the reference model is of a cascade"):
        simulate_reference(Run(), servo(tmp_path))


def test_long_windows_are_simulated_in_pieces_that_join(tmp_path, monkeypatch):
    from ema_model.models import closed_loop

    actuator = servo(tmp_path, PENDULUM)
    whole = let_go(actuator, 0.3, 2.0, 0.0)
    monkeypatch.setattr(closed_loop, "_CHUNK", 17)
    pieces = let_go(actuator, 0.3, 2.0, 0.0)
    for name, values in whole.items():
        np.testing.assert_array_equal(values, pieces[name], err_msg=name)
