"""Open loop: a recorded current, torque or force in, the motion out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.benches import Drive, Machine, simulated, waves

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.comparison import compare
from ema_model.comparison.residuals import OPEN_LOOP
from ema_model.discovery import begun
from ema_model.discovery.words import OPEN_LOOP_LEFT
from ema_model.errors import InputError
from ema_model.models.open_loop import simulate_open_loop
from ema_model.recordings import Measurement
from ema_model.simulation.run import Run, simulate_monitor
from emaviz.cli import main

AXIS = Path(__file__).parents[2] / "assets" / "actuators" / "ball_screw.toml"


@pytest.fixture(scope="module")
def axis():
    return load_actuator(AXIS)


@pytest.fixture(scope="module")
def run(axis):
    """The axis in its own loop, every step of the model recorded, so that the current is what flowed."""
    sine = command("sine", {"amplitude_rad": 0.02, "frequency_Hz": 3.0})
    return simulate_monitor(Run(sine, 0.5, 20_000.0), axis)


def test_the_current_that_flowed_brings_the_motion_about_again(axis, run):
    moved = simulate_open_loop(run, axis)
    for name in ("user_position_rad", "motor_position_rad", "motor_speed_rad_s"):
        assert np.max(np.abs(moved[name] - run[name])) < 1e-6 * np.ptp(run[name]), name
    np.testing.assert_array_equal(moved["current_A"], run["current_A"])


def test_a_torque_goes_in_as_it_is_and_without_motion_it_starts_at_rest(axis, run):
    torque = axis.motor.torque_constant_Nm_A * run["current_A"]
    bare = Measurement({"time_s": run.time_s, "motor_torque_Nm": torque}, "bare")
    other_constant = axis.with_values({"motor.torque_constant_Nm_A": 0.5})
    moved = simulate_open_loop(bare, other_constant)
    assert np.max(np.abs(moved["motor_position_rad"] - run["motor_position_rad"])) < 1e-6 * np.ptp(
        run["motor_position_rad"]
    )
    with pytest.raises(InputError, match="current_A"):
        simulate_open_loop(Measurement({"time_s": run.time_s, "command_rad": torque}), axis)


def test_a_comparison_in_open_loop_finds_what_differs(axis, run):
    """The motion alone is compared; a heavier table than the file's is found, and no controller is asked."""
    heavy = axis.with_values({"motor.inertia_kgm2": 1.1 * axis.motor.inertia_kgm2})
    sine = command("sine", {"amplitude_rad": 0.02, "frequency_Hz": 3.0})
    recorded = simulate_monitor(Run(sine, 0.5, 2000.0), heavy)
    free = ["motor.inertia_kgm2", "motor.dynamic_friction_Nm"]
    shown = axis.axes.outside(recorded.signals)
    found = compare([Measurement(shown, "heavy")], axis.in_open_loop(), free=free)
    assert set(found.signals) == {"user_position_m", "motor_position_rad", "motor_speed_rad_s"}
    inertia = found.calibration.parameters["motor.inertia_kgm2"]
    assert inertia.value == pytest.approx(heavy.motor.inertia_kgm2, rel=0.02)


def test_a_discovery_in_open_loop_puts_the_motion_in_where_it_can(axis, run):
    """Without the motor's own position it cannot, and says what its floor leaves out."""
    recorded = Measurement(axis.axes.outside(run.signals), "run")
    begun_with = begun([recorded], axis.in_open_loop())
    assert OPEN_LOOP_LEFT in begun_with.warnings and "current_A" in begun_with.data.told_in[0].noise
    alone = Measurement({name: one for name, one in recorded.signals.items() if name != "motor_position_rad"}, "table")
    begun_alone = begun([alone], axis.in_open_loop())
    assert OPEN_LOOP in begun_alone.warnings and "current_A" not in begun_alone.data.told_in[0].noise
    assert not {OPEN_LOOP, OPEN_LOOP_LEFT} & set(begun([recorded], axis).warnings)


def test_what_an_open_loop_leaves_out_has_no_tolerance_left():
    thesis = load_actuator().in_open_loop()
    assert thesis.controller.kind == "open" and thesis.inverter.kind == "current"
    assert not any(path.startswith(("controller.", "inverter.")) for path in thesis.tolerances)
    assert "motor.inertia_kgm2" in thesis.tolerances and "sensors.current_bias_A" not in thesis.tolerances


def test_command_line(tmp_path, capsys):
    given, out = tmp_path / "given.csv", tmp_path / "out.csv"
    sine = ["--command", "sine", "--set", "amplitude_rad=0.02", "--set", "frequency_Hz=3", "--model", "mm"]
    assert main(["simulate", *sine, "--actuator", str(AXIS), "--sample-rate", "2000", "--out", str(given)]) == 0
    assert main(["simulate", "--input", str(given), "--actuator", str(AXIS), "--out", str(out)]) == 0
    before, after = (np.genfromtxt(file, delimiter=",", names=True) for file in (given, out))
    assert np.max(np.abs(before["user_position_m"] - after["user_position_m"])) < 0.01 * np.ptp(
        before["user_position_m"]
    )
    assert main(["simulate", "--input", "absent.csv", "--out", str(tmp_path / "b.csv")]) == 2
    assert "absent.csv: no such file" in capsys.readouterr().err


DRIVEN = """
[controller]
kind = "open"
[motor]
torque_constant_Nm_A = { value = 0.1, tolerance = 0.03 }
inertia_kgm2 = { value = 1.5e-4, tolerance = 0.15 }
viscous_friction_Nms_rad = { value = 1.5e-4, tolerance = 0.3 }
static_friction_Nm = 0.02
dynamic_friction_Nm = { value = 0.03, tolerance = 0.15 }
"""


def test_a_current_that_holds_until_the_next_comes_late_and_its_scale_stays_open(tmp_path):
    """All torques over the inertia are told and none of them alone: a constant that is known by 3 % stays so."""
    (tmp_path / "motor.toml").write_text(DRIVEN, encoding="utf-8")
    motor = Machine(torque_constant=0.104, inertia=1.45e-4, viscous=1.7e-4, dry=0.031)
    seen = simulated(motor, Drive("current"), waves(np.random.default_rng(4), 1.1, 6.0, 0.6), 1000.0, 2.5)
    position = np.round(seen["motor"] / 4e-4) * 4e-4
    log = Measurement({"time_s": seen["time"], "current_A": seen["command"], "motor_position_rad": position}, "log")
    found = compare([log], load_actuator(tmp_path / "motor.toml"))
    assert found.adequate and found.calibration is not None
    told = found.calibration.parameters
    assert told["sensors.delay_s"].value == pytest.approx(0.9e-3, abs=0.3e-3)
    low, high = told["motor.torque_constant_Nm_A"].interval90
    assert low < motor.torque_constant < high and high - low > 0.06 * motor.torque_constant
    ratio = told["motor.torque_constant_Nm_A"].value / told["motor.inertia_kgm2"].value
    assert ratio == pytest.approx(motor.torque_constant / motor.inertia, rel=0.01)
