"""The field's own methods beside discovery: they recover what they are told to find, by one measure for all."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.campaign import benchmark
from ema_model.campaign.benchmark import BENCHMARK, Settings, chosen, followed, needed
from ema_model.campaign.task import TaskInputs
from ema_model.errors import InputError
from ema_model.recordings import Measurement

ASSETS = Path(__file__).parents[2] / "assets"
SERVO = load_actuator(ASSETS / "actuators" / "xl330.toml")
BENCH = benchmark.Bench()
TRUE = {
    "torque_constant_Nm_A": 0.4,
    "resistance_Ohm": 3.5,
    "armature_kgm2": 2e-3,
    "offset_rad": 0.03,
    "coulomb_Nm": 0.02,
    "viscous_Nms_rad": 0.01,
    "load": 0.2,
}


def bam_logs(parameters, gains=(100, 400)) -> list[Measurement]:
    """What a model of BAM's would record, sampled as it steps."""
    time = benchmark.STEP_S * np.arange(800)
    found = []
    for gain in gains:
        goal = np.sin(time**2)
        blank = Measurement(
            {"time_s": time, "command_rad": goal, "user_position_rad": 0.0 * goal}, name=f"xl330_kp{gain}_made"
        )
        logs = benchmark.Logs.of([blank], SERVO)
        row = np.array([parameters.get(name, 0.0) for name in benchmark.BOUNDS])
        shown = np.append(logs.simulated(row, BENCH), 0.0)[: time.size]
        found.append(blank.with_signals(user_position_rad=shown))
    return found


def test_bam_steps_as_its_authors_do():
    """Two steps of M4 by hand, with numbers put into the equations of bam/simulate.py and bam/model.py."""
    parameters = TRUE | {
        "stribeck_Nm": 0.03,
        "stribeck_speed_rad_s": 0.5,
        "stribeck_exponent": 1.5,
        "load_stribeck": 0.1,
    }
    time = benchmark.STEP_S * np.arange(3)
    blank = Measurement(
        {"time_s": time, "command_rad": np.full(3, 0.8), "user_position_rad": np.full(3, 0.3)}, name="xl330_kp400_made"
    )
    logs = benchmark.Logs.of([blank], SERVO)
    shown = logs.simulated(np.array([parameters.get(name, 0.0) for name in benchmark.BOUNDS]), BENCH)
    gain, dt = 400 * (4096 / (2 * np.pi)) / (256 * 885), 5e-3
    inertia, q, dq = 0.49 * 0.1**2 + 2e-3, 0.3, 0.0
    for expected in shown:
        assert q == pytest.approx(expected, abs=1e-6)
        volts = 7.4 * min(1.0, gain * (0.8 - q))
        motor = 0.4 * volts / 3.5 - 0.4**2 * dq / 3.5
        bias = 0.49 * -9.80665 * 0.1 * np.sin(q + 0.03)
        bears = abs(bias - motor)
        loss = 0.02 + 0.2 * bears + np.exp(-((abs(dq) / 0.5) ** 1.5)) * (0.03 + 0.1 * bears)
        stop = inertia / dt * dq + motor + bias
        net = motor + bias - np.sign(stop) * min(abs(stop), loss + 0.01 * abs(dq))
        dq += net / inertia * dt
        q += dq * dt + 0.5 * net / inertia * dt**2


@pytest.mark.parametrize("name", ["m1", "m3"])
def test_bam_recovers_its_own_parameters(name):
    true = {one: TRUE[one] for one in benchmark.MODELS[name]}
    logs = benchmark.Logs.of(bam_logs(true), SERVO)
    found = benchmark.fit(name, logs, BENCH, 1, starts=2, evaluations=5000)
    assert found.error_rad < 1e-4
    for one in ("coulomb_Nm", "offset_rad", *(["load"] if name == "m3" else [])):
        assert found.parameters[one] == pytest.approx(true[one], rel=0.05), one
    ratio = found.parameters["torque_constant_Nm_A"] / found.parameters["resistance_Ohm"]
    assert ratio == pytest.approx(0.4 / 3.5, rel=0.05)


def test_larger_models_hold_the_smaller_ones():
    logs = benchmark.Logs.of(bam_logs(TRUE), SERVO)
    assert np.all(logs.errors_rad(TRUE, BENCH) < 1e-12)
    as_m6 = {name: TRUE.get(name, 0.0) for name in benchmark.MODELS["m6"]}
    as_m6 |= {"load_motor": 0.2, "load_external": 0.2, "stribeck_speed_rad_s": 0.1, "stribeck_exponent": 1.0}
    assert np.all(logs.errors_rad(as_m6, BENCH) < 1e-9)
    assert np.all(logs.errors_rad(TRUE | {"load": 0.0}, BENCH) > 1e-3)


def test_cma_es_finds_the_bottom_of_a_bent_valley():
    def banana(unit):
        x = 4.0 * unit - 2.0
        return float(np.sum(100.0 * (x[1:] - x[:-1] ** 2) ** 2 + (1.0 - x[:-1]) ** 2))

    least, where = benchmark.minimised(banana, 4, np.random.default_rng(2), 8000)
    assert least < 1e-5
    np.testing.assert_allclose(where, 0.75, atol=2e-3)
    edge, at = benchmark.minimised(lambda unit: float(np.sum(unit)), 3, np.random.default_rng(2), 3000)
    assert edge == pytest.approx(0.0, abs=1e-6) and np.all(at >= 0.0)


def joint(seconds: float, speed: float) -> Measurement:
    """A joint with gravity that goes to and fro, as current: 0.3 q̈ + 0.8 q̇ + 0.5 sgn q̇ + 2 sin q − cos q + 0.1, A."""
    time = 2e-3 * np.arange(round(seconds / 2e-3))
    q, dq, ddq = (
        np.sin(speed * time),
        speed * np.cos(speed * time),
        -(speed**2) * np.sin(speed * time),
    )
    current = 0.3 * ddq + 0.8 * dq + 0.5 * np.sign(dq) + 2.0 * np.sin(q) - np.cos(q) + 0.1
    return Measurement({"time_s": time, "motor_position_rad": q, "current_A": current}, name=f"joint at {speed:g}")


def test_least_squares_finds_what_a_joint_is_made_of():
    actuator = load_actuator(ASSETS / "field" / "ur10e.toml")
    inputs = TaskInputs(actuator, [joint(12.0, 1.3), joint(12.0, 2.1)], [joint(12.0, 1.7)])
    row = BENCHMARK.run(inputs, Settings(method="least_squares", measure="torque"), 0)
    assert row["held_out_error"] < 0.5 and row["fitted_error"] < 0.5 and row["unit"] == "%"
    found = json.loads(row["parameters"])
    for name, true in {"inertia": 0.3, "viscous": 0.8, "coulomb": 0.5, "sin": 2.0, "cos": -1.0, "offset": 0.1}.items():
        assert found[name] == pytest.approx(true, abs=0.02), name
    as_file = actuator.varied(
        {
            "motor.inertia_kgm2": 3.0,
            "motor.viscous_friction_Nms_rad": 8.0,
            "motor.dynamic_friction_Nm": 5.0,
            "sensors.current_bias_A": 0.1,
        }
    )
    (without_gravity,) = needed(inputs.held, as_file)
    gravity = np.hypot(2.0, 1.0)
    assert 20.0 < without_gravity < 100.0 * gravity


def test_least_squares_finds_a_servo_that_its_position_error_drives():
    """0.004 q̈ + 0.1 q̇ + 0.02 sgn q̇ + 0.05 cos q, by steps of its own that are finer than those of the peer."""
    actuator = load_actuator(ASSETS / "field" / "hobby.toml")

    def made(name, shape):
        time, step = 0.01 * np.arange(600), 1e-4
        goal, q, dq, shown = shape(time), 0.0, 0.0, []
        for i in range(time.size):
            shown.append(q)
            for _ in range(100):
                net = goal[i] - q - 0.1 * dq - 0.05 * np.cos(q)
                stop = 0.004 / step * dq + net
                net -= np.sign(stop) * min(abs(stop), 0.02)
                dq += net / 0.004 * step
                q += dq * step
        return Measurement({"time_s": time, "command_rad": goal, "user_position_rad": np.array(shown)}, name=name)

    one = made("a", lambda t: 0.8 * np.sin(1.1 * t) + 0.2 * np.sin(3.7 * t))
    other = made("b", lambda t: 0.9 * np.sin(0.7 * t) + 0.3 * np.sin(2.9 * t))
    row = BENCHMARK.run(TaskInputs(actuator, [one], [other]), Settings(method="least_squares", measure="following"), 0)
    found = json.loads(row["parameters"])
    for name, true in {"viscous": 0.1, "coulomb": 0.02, "cos": 0.05, "sin": 0.0}.items():
        assert found[name] == pytest.approx(true, abs=0.01), name
    assert row["held_out_error"] < 10.0 and row["unit"] == "mrad"


def test_a_servo_is_held_to_bams_measure():
    """A pendulum servo of the file itself, as BAM's M1 steps it: the two programs differ by their steps alone."""
    value = SERVO.value
    same = {
        "torque_constant_Nm_A": value("motor.torque_constant_Nm_A"),
        "resistance_Ohm": value("motor.resistance_Ohm"),
        "armature_kgm2": value("motor.inertia_kgm2") - 0.49 * 0.1**2,
        "coulomb_Nm": value("motor.dynamic_friction_Nm"),
        "viscous_Nms_rad": value("motor.viscous_friction_Nms_rad"),
    }
    logs = [
        one.with_signals(bus_voltage_V=np.full(one.samples, 7.4), drive_enabled=np.ones(one.samples))
        for one in bam_logs(same)
    ]
    assert max(followed(logs, SERVO)) < 8.0  # mrad, of a motion of a radian
    stiffer = SERVO.varied({"motor.dynamic_friction_Nm": 0.06})
    assert min(followed(logs, stiffer)) > 12.0


def test_discovery_never_sees_what_is_held_out(monkeypatch):
    class Asked(Exception):
        pass

    def asked(measurements, actuator, **options):
        assert [one.name for one in measurements] == ["joint at 1.3"] and not options.get("holdout")
        raise Asked

    monkeypatch.setattr("ema_model.campaign.benchmark.discover", asked)
    inputs = TaskInputs(load_actuator(ASSETS / "field" / "ur10e.toml"), [joint(4.0, 1.3)], [joint(4.0, 1.7)])
    with pytest.raises(Asked):
        BENCHMARK.run(inputs, Settings(measure="torque"), 0)


def test_what_no_method_can_do_is_refused_in_one_line():
    for wrong, told in (
        ({"method": "bam_m7"}, "no method 'bam_m7'; there are discover, bam_m1"),
        ({"measure": "guess"}, "no measure 'guess'; there are following"),
        ({"method": "bam_m1", "measure": "torque"}, "follow a command"),
    ):
        with pytest.raises(InputError, match=told):
            Settings(**wrong)
    with pytest.raises(InputError, match="held out"):
        BENCHMARK.run(TaskInputs(SERVO, [], []), Settings(), 0)


def test_the_choice_by_training_error_is_not_the_one_in_hindsight():
    rows = [
        {"method": "discover", "fitted_error": 9.0, "held_out_error": 2.0},
        {"method": "bam_m1", "fitted_error": 3.0, "held_out_error": 1.0},
        {"method": "bam_m5", "fitted_error": 1.0, "held_out_error": 4.0},
    ]
    picked = {name: row["method"] for name, row in chosen(rows).items()}
    assert picked == {"ours": "discover", "by training error": "bam_m5", "in hindsight": "bam_m1"}
