"""Static maps beside angle: a dynamometer's torque against current, friction against speed; made by hand here."""

from __future__ import annotations

import json

import numpy as np
import pytest

from ema_model.actuator import Actuator, load_actuator
from ema_model.comparison import compare
from ema_model.discovery import discover
from ema_model.errors import InputError
from ema_model.recordings import Measurement, read
from ema_model.recordings.side_file import SideFile
from emaviz.cli import main

CONSTANT, DRY, VISCOUS = 0.082, 0.021, 1.6e-4  # N·m/A, N·m, N·m·s/rad
FILE = """
[controller]
kind = "{kind}"
[motor]
torque_constant_Nm_A = {{ value = 0.09, tolerance = 0.1 }}
inertia_kgm2 = 1e-4
viscous_friction_Nms_rad = {{ value = 1e-4, sigma = 1e-4 }}
static_friction_Nm = 0.02
dynamic_friction_Nm = {{ value = 0.015, sigma = 0.01 }}
"""
SERVO = """
[inverter]
kind = "current"
current_limit_A = 20.0
"""


def motor(folder, kind: str = "unknown") -> Actuator:
    text = FILE.format(kind=kind)
    if kind == "position":
        text = text.replace('kind = "position"', 'kind = "position"\ngain_1_rad = 1.0') + SERVO
    (folder / "motor.toml").write_text(text, encoding="utf-8")
    return load_actuator(folder / "motor.toml")


def friction(speed, law=None):
    """What the bearings take, N·m, at constant speeds; law: of the speed's size, besides."""
    more = 0.0 if law is None else law(np.abs(speed))
    return np.sign(speed) * (DRY + more) + VISCOUS * speed


def speeds(number: int, top: float = 300.0):
    """Either way, the low ones close together."""
    one_way = np.geomspace(2.0, top, number)
    return np.concatenate([-one_way[::-1], one_way])


def no_load(seed: int, law=None, number: int = 40, top: float = 300.0) -> Measurement:
    """Current against speed of a motor that turns alone."""
    random = np.random.default_rng(seed)
    speed = speeds(number, top)
    current = friction(speed, law) / CONSTANT + 2e-3 * random.standard_normal(speed.size)
    return Measurement(
        {"time_s": np.arange(float(speed.size)), "motor_speed_rad_s": speed, "current_A": current},
        name=f"no load {seed}",
        side=SideFile(kind="map"),
    )


def loaded(seed: int, saturation: float = 0.0, torque: str = "load_torque_Nm", most_A: float = 12.0) -> Measurement:
    """A dynamometer's table: the torque at the shaft for each current, at a few speeds; its rows as they came."""
    random = np.random.default_rng(seed)
    current, speed = (one.ravel() for one in np.meshgrid(np.linspace(-most_A, most_A, 25), [30.0, 100.0, 200.0]))
    given = CONSTANT * current / (1.0 + saturation * np.abs(current)) - friction(speed)
    given += 2e-3 * random.standard_normal(given.size)
    order = np.argsort(given, kind="stable")
    signals = {"motor_speed_rad_s": speed, torque: given, "current_A": current}
    return Measurement(
        {"time_s": np.arange(float(given.size)), **{name: values[order] for name, values in signals.items()}},
        name=f"dynamometer {seed}",
        side=SideFile(kind="map"),
    )


def holds(parameters, path: str, true: float) -> bool:
    low, high = parameters[path].interval90
    return low <= true <= high


@pytest.mark.parametrize("torque", ["load_torque_Nm", "motor_torque_Nm"])
def test_a_dynamometer_s_table_tells_constant_and_friction(tmp_path, torque):
    found = compare(
        [loaded(seed, torque=torque) for seed in range(2)], motor(tmp_path), holdout=[loaded(5, torque=torque)]
    )
    assert found.adequate and found.calibration is not None
    told = found.calibration.parameters
    assert told["motor.torque_constant_Nm_A"].value == pytest.approx(CONSTANT, rel=0.01)
    assert told["motor.dynamic_friction_Nm"].value == pytest.approx(DRY, rel=0.05)
    assert holds(told, "motor.torque_constant_Nm_A", CONSTANT) and holds(told, "motor.dynamic_friction_Nm", DRY)


def test_friction_against_speed_is_fitted_whatever_the_controller(tmp_path):
    for kind in ("unknown", "position"):
        found = compare([no_load(1)], motor(tmp_path, kind))
        assert found.adequate and found.calibration is not None
        told = found.calibration.parameters
        ratio = told["motor.dynamic_friction_Nm"].value / found.calibration.actuator.motor.torque_constant_Nm_A
        assert ratio == pytest.approx(DRY / CONSTANT, rel=0.02)


def test_saturation_is_named_from_torque_against_current(tmp_path):
    found = discover([loaded(seed, 0.015) for seed in range(2)], motor(tmp_path), holdout=[loaded(5, 0.015)])
    [one] = found.effects
    assert one.name == "torque_saturation" and found.verdict == "effects_found"
    assert one.parameters["saturation_1_A"].value == pytest.approx(0.015, rel=0.1)


@pytest.mark.parametrize(
    ("law", "name", "parameter", "true"),
    [
        (lambda speed: 0.02 * np.exp(-((speed / 12.0) ** 2)), "stribeck_friction", "speed_rad_s", 12.0),
        (lambda speed: 0.05 * speed / (speed + 50.0), "saturating_friction", "half_speed_rad_s", 50.0),
        (lambda speed: 0.004 * np.sqrt(speed), "power_law_drag", "exponent", 0.5),
    ],
)
def test_a_bent_friction_curve_is_named_from_current_against_speed(tmp_path, law, name, parameter, true):
    found = discover([no_load(seed, law) for seed in range(2)], motor(tmp_path), holdout=[no_load(5, law)])
    [one] = found.effects
    assert one.name == name and found.ladder[-1].rmse < 1.2
    assert one.parameters[parameter].value == pytest.approx(true, rel=0.3)


def test_nothing_is_named_where_nothing_is_missing(tmp_path):
    for maps in ([no_load(1), no_load(2)], [loaded(1), loaded(2)]):
        found = discover(maps, motor(tmp_path))
        assert found.verdict == "adequate" and not found.effects


def test_a_short_table_is_read_whatever_the_order_of_its_rows(tmp_path):
    """Fifteen rows of rpm and mA, up and down; from the file to the answer."""
    shuffled = np.random.default_rng(3).permutation(30)
    one = no_load(4, number=15)
    rows = np.column_stack([one["motor_speed_rad_s"] * 30.0 / np.pi, 1e3 * one["current_A"]])[shuffled]
    file = tmp_path / "friction.csv"
    np.savetxt(file, rows, delimiter=",", header="n_rpm,I_mA", comments="", fmt="%.6g")
    file.with_suffix(".toml").write_text(
        'kind = "map"\n[mapping]\nmotor_speed_rad_s = "n_rpm[rpm]"\ncurrent_A = "I_mA[mA]"\n', encoding="utf-8"
    )
    actuator = motor(tmp_path)
    known = read(file, actuator)
    assert known.samples == 30 and np.all(np.diff(known["motor_speed_rad_s"]) > 0.0)
    out = tmp_path / "out.json"
    assert main(["compare", str(file), "--actuator", str(tmp_path / "motor.toml"), "--json", str(out)]) == 0
    told = json.loads(out.read_text())
    assert told["adequate"] and "motor.dynamic_friction_Nm" in told["calibration"]["parameters"]


def test_a_map_along_nothing_is_refused(tmp_path):
    bare = Measurement(
        {"time_s": np.arange(200.0), "current_A": np.linspace(0.0, 1.0, 200)}, name="bare", side=SideFile(kind="map")
    )
    with pytest.raises(InputError, match="bare: a static map goes along one of motor_position_rad"):
        compare([bare], motor(tmp_path))
    few = tmp_path / "few.csv"
    few.write_text("motor_speed_rad_s,current_A\n" + "".join(f"{n},{0.1 * n}\n" for n in range(1, 9)))
    few.with_suffix(".toml").write_text('kind = "map"\n')
    with pytest.raises(InputError, match="8 samples; 12 or more are expected, measure at more points"):
        read(few, motor(tmp_path))
