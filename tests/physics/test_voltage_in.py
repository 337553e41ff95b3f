"""Voltage or duty in, speed out: the winding makes the current, and what a log tells of it is found again."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.duty_bench import Bench, logged, staircase

from ema_model.actuator import load_actuator
from ema_model.actuator.describe import described
from ema_model.comparison import compare
from ema_model.comparison.residuals import OPEN_LOOP
from ema_model.errors import InputError
from ema_model.estimation.calibrate import told
from ema_model.models.open_loop import simulate_open_loop
from ema_model.recordings import Measurement
from emaviz.cli import main

CASE = Path(__file__).parents[3] / "shared" / "cases" / "duty_speed_dc"
FREE = ("motor.torque_constant_Nm_A", "motor.inertia_kgm2", "motor.viscous_friction_Nms_rad")


def bench_file(bus_V: float | None = 12.0, resistance_tolerance: float = 0.05, **values: float):
    """What its owner says of a `Bench`: all a good deal off."""
    motor = {"torque_constant_Nm_A": (0.0115, 0.2), "inertia_kgm2": (2e-6, 0.5), "dynamic_friction_Nm": (1e-3, 0.3)}
    motor |= {"viscous_friction_Nms_rad": (1e-6, 1.0), "resistance_Ohm": (5.0, resistance_tolerance)}
    document = {"motor": {name: {"value": value, "tolerance": one} for name, (value, one) in motor.items()}}
    document["motor"]["static_friction_Nm"] = {"value": 1e-3, "free": False}
    document["motor"] |= {name: {"value": value} for name, value in values.items()}
    if bus_V is not None:
        document["inverter"] = {"bus_voltage_V": {"value": bus_V, "free": False, "tolerance": 0.02}}
    return described({"name": "bench", **document}, "open", "voltage", "bench", 1000.0)


def combinations(actuator) -> dict[str, float]:
    """What a duty → speed log can tell: a time constant, a speed per volt, and what friction takes, in V."""
    motor, r, k = actuator.motor, actuator.motor.resistance_Ohm, actuator.motor.torque_constant_Nm_A
    damping = k * k + r * motor.viscous_friction_Nms_rad
    return {
        "time constant": r * motor.inertia_kgm2 / damping,
        "speed per volt": k / damping,
        "friction": r * motor.dynamic_friction_Nm / k,
    }


TRUE = Bench()
KNOWN = combinations(
    bench_file(
        torque_constant_Nm_A=TRUE.torque_constant_Nm_A,
        inertia_kgm2=TRUE.inertia_kgm2,
        viscous_friction_Nms_rad=TRUE.viscous_Nms_rad,
        dynamic_friction_Nm=TRUE.dry_Nm,
        resistance_Ohm=TRUE.resistance_Ohm,
    )
)


@pytest.fixture(scope="module")
def log():
    return Measurement(logged(TRUE, 1, turns=False), "bench")


@pytest.fixture(scope="module")
def fitted(log):
    return compare([log], bench_file(resistance_tolerance=0.2))


@pytest.mark.parametrize("inductance_H", [0.0, 2e-3])
def test_the_winding_makes_the_current_and_the_current_the_motion(inductance_H):
    bench = replace(TRUE, inductance_H=inductance_H)
    time_s = np.arange(800) / 1000.0
    duty = staircase(time_s, 3)
    speed, current = bench.run(time_s, duty, substeps=100)
    model = bench_file(
        torque_constant_Nm_A=TRUE.torque_constant_Nm_A,
        inertia_kgm2=TRUE.inertia_kgm2,
        viscous_friction_Nms_rad=TRUE.viscous_Nms_rad,
        dynamic_friction_Nm=TRUE.dry_Nm,
        static_friction_Nm=TRUE.dry_Nm,
        **({"inductance_H": inductance_H} if inductance_H else {}),
    )
    model = replace(model, step_s=1e-5)
    for signals in ({"duty": duty}, {"motor_voltage_V": 12.0 * duty}):
        shown = simulate_open_loop(Measurement({"time_s": time_s, **signals}), model)
        assert np.max(np.abs(shown["motor_speed_rad_s"] - speed)) < 2e-3 * np.ptp(speed)
        assert np.sqrt(np.mean((shown["current_A"] - current)[2:] ** 2)) < 0.05 * np.std(current)
        assert set(signals) <= set(shown.signals)


def test_speed_alone_tells_the_combinations_that_it_can(fitted):
    """Each within its interval and some per cent, though no one parameter is known as well."""
    assert fitted.adequate and set(fitted.signals) == {"motor_speed_rad_s"} and fitted.primary == "motor_speed_rad_s"
    assert OPEN_LOOP not in fitted.warnings  # the back-EMF damps what the input's noise does
    for name, value in combinations(fitted.calibration.actuator).items():
        assert value == pytest.approx(KNOWN[name], rel=0.06 if name == "friction" else 0.02), name


def test_what_is_known_only_together_is_said_so(fitted):
    """The resistance scales all of them: the log does not tell it from the others, and its tolerance is left."""
    of = {one.name: one for one in told(fitted.calibration)}
    assert of["motor.resistance_Ohm"].left > 0.7
    assert of["motor.resistance_Ohm"].is_confounded and set(of["motor.resistance_Ohm"].like) & {
        *FREE,
        "motor.dynamic_friction_Nm",
    }
    assert fitted.calibration.confounded


def test_with_the_current_beside_it_each_is_known(log):
    """k from the speed's back-EMF, R from the current, J and friction from the torque."""
    time_s, duty = log.time_s, log["duty"]
    speed, current = TRUE.run(time_s, duty, 150.0)
    noise = np.random.default_rng(5).standard_normal((2, len(time_s)))
    both = Measurement(
        {
            "time_s": time_s,
            "duty": duty,
            "motor_speed_rad_s": speed + 2.0 * noise[0],
            "current_A": current + 0.01 * noise[1],
        },
        "both",
    )
    found = compare([both], bench_file(resistance_tolerance=0.2))
    assert found.calibration is not None
    values = found.calibration.actuator.motor
    assert found.adequate and set(found.signals) == {"current_A", "motor_speed_rad_s"}
    assert values.resistance_Ohm == pytest.approx(TRUE.resistance_Ohm, rel=0.02)
    assert values.torque_constant_Nm_A == pytest.approx(TRUE.torque_constant_Nm_A, rel=0.02)
    assert values.inertia_kgm2 == pytest.approx(TRUE.inertia_kgm2, rel=0.03)


def test_a_voltage_and_a_duty_of_a_recorded_supply_are_the_same(log):
    """The supply sags by a third under way: with its column, or the motor's voltage, nothing else changes."""
    time_s = log.time_s
    bus = np.linspace(15.0, 10.0, len(time_s))
    duty = log["duty"] * 12.0 / bus
    by_duty = {"time_s": time_s, "duty": duty, "bus_voltage_V": bus, "motor_speed_rad_s": log["motor_speed_rad_s"]}
    by_volts = {"time_s": time_s, "motor_voltage_V": duty * bus, "motor_speed_rad_s": log["motor_speed_rad_s"]}
    sagging = {"bus_voltage_sag": {"drop_V": 1.0}}
    for signals, effects, apart in (
        (by_duty, {}, False),
        (by_volts, {}, False),
        (by_volts, sagging, False),
        (by_duty, sagging, True),
    ):
        shown = simulate_open_loop(Measurement(signals), bench_file(None), effects=effects)
        plain = simulate_open_loop(log, bench_file())
        error = np.max(np.abs(shown["motor_speed_rad_s"] - plain["motor_speed_rad_s"])) / np.ptp(
            plain["motor_speed_rad_s"]
        )
        assert (error > 0.02) == apart, (list(signals), effects, error)


def test_what_is_not_known_of_a_duty_is_asked_for(log):
    with pytest.raises(InputError, match="bus_voltage_V"):
        compare([log], bench_file(None))
    counted = Measurement({**log.signals, "duty": 600.0 * log["duty"]}, "counted")
    with pytest.raises(InputError, match=r"duty goes to .*within ±1.*--map"):
        compare([counted], bench_file())
    with pytest.raises(InputError, match=r"motor_voltage_V.*or duty"):
        compare([Measurement({name: log[name] for name in ("time_s", "motor_speed_rad_s")}, "none")], bench_file())


@pytest.mark.parametrize(
    ("name", "full", "most", "said"),
    [
        ("pwm", 255, 255, "/255"),
        ("duty", 999, 999, "/999"),
        ("duty", 100, 100, "%"),
        ("duty", 1, 1, None),
        ("pwm", 255, 180, ""),
        ("duty", 999, 600, ""),
    ],
)
def test_the_scale_of_a_duty_is_guessed_aloud_or_asked_for(name, full, most, said, log, tmp_path, capsys):
    """said: what it is taken for on stderr; None where there is nothing to say, "" where it is asked for."""
    file, out = tmp_path / "log.csv", tmp_path / "out.csv"
    duty = np.where(log["duty"] > 0.5, most, 0.3 * most)
    write(file, {"time_s": log.time_s, "motor_speed_rad_s": log["motor_speed_rad_s"], name: duty})
    actuator = actuator_file(tmp_path)
    code = main(["simulate", "--input", str(file), "--actuator", actuator, "--out", str(out)])
    told_of = capsys.readouterr().err
    assert code == (2 if said == "" else 0)
    if said == "":
        assert "--map" in told_of and f"{most}" in told_of and "duty" in told_of
        by_hand = ["--map", f"duty={name}[/{full}]"]
        assert main(["simulate", "--input", str(file), "--actuator", actuator, "--out", str(out), *by_hand]) == 0
    else:
        assert (f"[{said}] (up to {most}" in told_of) == (said is not None)
    assert np.max(np.genfromtxt(out, delimiter=",", names=True)["duty"]) == pytest.approx(most / full)


def test_command_line(log, tmp_path, capsys):
    """From the options to the answer: time, duty and speed are enough."""
    file = tmp_path / "log.csv"
    write(file, {"time_s": log.time_s, "duty": log["duty"], "motor_speed_rad_s": log["motor_speed_rad_s"]})
    actuator = actuator_file(tmp_path)
    assert load_actuator(actuator).takes_voltage
    for more in ([], ["--open-loop"]):
        assert main(["compare", str(file), "--actuator", actuator, *more]) == 0
        assert "The model explains the recordings: the residual motor speed" in capsys.readouterr().out


def test_in_open_loop_of_a_servo_with_a_voltage_drive_its_duty_goes_in(log, tmp_path, capsys):
    file, servo = tmp_path / "log.csv", str(tmp_path / "servo.toml")
    write(file, {"time_s": log.time_s, "duty": log["duty"], "motor_speed_rad_s": log["motor_speed_rad_s"]})
    assert main(["actuator", "new", servo, "--controller", "position", "--drive", "voltage", *SAID]) == 0
    assert main(["compare", str(file), "--actuator", servo, "--open-loop"]) == 0
    assert "The model explains the recordings: the residual motor speed" in capsys.readouterr().out
    with_current = load_actuator(servo).in_open_loop(["current_A", "duty"])
    assert with_current.controller.kind == "open" and with_current.inverter.kind == "current"


SAID = [
    *("--set", "motor.resistance_Ohm=5±5%", "--set", "motor.torque_constant_Nm_A=0.0115±20%"),
    *("--set", "motor.inertia_kgm2=2e-6±50%", "--set", "motor.viscous_friction_Nms_rad=1e-6±100%"),
    *("--set", "motor.dynamic_friction_Nm=1e-3±30%", "--set", "inverter.bus_voltage_V=12 fixed"),
    *("--sample-rate", "1000"),
]


def actuator_file(folder: Path) -> str:
    file = str(folder / "bench.toml")
    assert main(["actuator", "new", file, "--controller", "open", "--drive", "voltage", *SAID]) == 0
    return file


def write(file: Path, columns: dict[str, np.ndarray]) -> None:
    table = np.column_stack(list(columns.values()))
    np.savetxt(file, table, fmt="%.9g", delimiter=",", header=",".join(columns), comments="")


@pytest.mark.long
@pytest.mark.skipif(not CASE.is_dir(), reason="the logs of strangers are not here")
@pytest.mark.parametrize("step", ["step_up_600_999_1kHz", "step_down_999_600_1kHz"])
def test_a_stranger_s_bench_is_represented(step, tmp_path, capsys):
    """Duty of 999 and counts/s of 1456 a turn of the output, 28 of the motor's: one step, within a few per cent."""
    with (CASE / f"{step}.csv").open() as table:
        rows = list(csv.DictReader(table))
    turn = 28.0 * 2.0 * np.pi / 1456.0
    file = tmp_path / "step.csv"
    columns = {"i_ms": [row["i_ms"] for row in rows], "duty": [row["duty"] for row in rows]}
    columns["motor_speed_rad_s"] = [turn * float(row["vfilt_cps"]) for row in rows]
    write(file, {name: np.array(values, float) for name, values in columns.items()})
    asked = ["compare", str(file), "--actuator", actuator_file(tmp_path), "--map", "time_s=i_ms[ms]"]
    if step.startswith("step_down"):  # which nowhere goes to full duty
        assert main(asked) == 2 and "its duty goes to 600" in capsys.readouterr().err
        asked += ["--map", "duty=duty[/999]"]
    assert main(asked) == 0
    shown = capsys.readouterr()
    assert ("duty from duty [/999]" in shown.err) == step.startswith("step_up")
    line = next(line for line in shown.out.splitlines() if line.lstrip().startswith("Motor speed"))
    assert float(line.split("%")[0].split()[-1]) < 4.0, "of range"
