"""The actuator's file: what is shipped, what is read, and what is refused in one clear line."""

from __future__ import annotations

import pytest

from ema_model.actuator import Tolerance, load_actuator, paths, shipped
from ema_model.errors import InputError

TEXT = shipped("thesis.toml")
RESISTANCE = "resistance_Ohm = { value = 2.13, tolerance = 0.05 }"


def written(tmp_path, old: str, new: str):
    """The shipped file with one piece of text changed."""
    assert TEXT.count(old) >= 1
    path = tmp_path / "mine.toml"
    path.write_text(TEXT.replace(old, new, 1), encoding="utf-8")
    return path


def test_shipped_values_are_the_thesis():
    a = load_actuator()
    assert a.name == "Thesis EMA"
    expected = {
        "controller.position_gain_1_s": 1e5,
        "controller.speed_gain_Nms_rad": 0.05,
        "controller.integral_gain_Nm_rad": 0.0,
        "controller.derivative_gain_Nms2_rad": 0.0,
        "controller.torque_constant_Nm_A": 0.0752,
        "controller.current_limit_A": 22.5,
        "inverter.bus_voltage_V": 48.0,
        "inverter.hysteresis_band_A": 0.5,
        "motor.resistance_Ohm": 2.13,
        "motor.inductance_H": 0.72e-3,
        "motor.torque_constant_Nm_A": 0.0752,
        "motor.emf_scale": 2.0**0.5,
        "motor.pole_pairs": 2.0,
        "motor.torque_limit_Nm": 1.689,
        "motor.inertia_kgm2": 1.3e-5,
        "motor.viscous_friction_Nms_rad": 9.549e-6,
        "motor.static_friction_Nm": 0.06 * 1.689,
        "motor.dynamic_friction_Nm": 0.03 * 1.689,
        "transmission.gear_ratio": 1.0 / 500.0,
        "transmission.backlash_rad": 1e-5,
        "transmission.viscous_friction_Nms_rad": 4.507e-7,
        "transmission.stop_low_rad": -1.5,
        "transmission.stop_high_rad": 1.5,
        "sensors.current_gain": 1.0,
    }
    for path, value in expected.items():
        assert a.value(path) == pytest.approx(value, rel=1e-9, abs=1e-15), path
    assert a.controller.speed_limit_rad_s == pytest.approx(8000.0 * 2.0 * 3.14159265 / 60.0, rel=1e-5)


def test_shipped_tolerances():
    relative = {
        "motor.inertia_kgm2": 0.05,
        "motor.torque_constant_Nm_A": 0.01,
        "motor.resistance_Ohm": 0.05,
        "motor.inductance_H": 0.10,
        "inverter.bus_voltage_V": 0.02,
        "motor.viscous_friction_Nms_rad": 0.15,
        "motor.static_friction_Nm": 0.05,
        "motor.dynamic_friction_Nm": 0.05,
        "transmission.backlash_rad": 0.15,
        "controller.speed_gain_Nms_rad": 0.01,
        "controller.position_gain_1_s": 0.01,
        "sensors.current_gain": 0.005,
    }
    absolute = {"sensors.current_bias_A": 0.02, "sensors.delay_s": 20e-6}
    a = load_actuator()
    for path, share in relative.items():
        assert a.tolerances[path].sigma == pytest.approx(share * a.value(path)) and a.tolerances[path].free, path
    for path, sigma in absolute.items():
        assert a.tolerances[path] == Tolerance(sigma, True), path
    offset = a.tolerances["motor.rotor_offset_rad"]
    assert offset.sigma > 0.0 and not offset.free
    assert set(a.tolerances) == set(relative) | set(absolute) | {"motor.rotor_offset_rad"}


def test_paths_name_every_value_once():
    a = load_actuator()
    assert len(set(paths())) == len(paths()) > 25
    assert all(isinstance(a.value(path), float) for path in paths())


def test_own_file_reads_numbers_tables_and_tolerances(tmp_path):
    a = load_actuator(written(tmp_path, RESISTANCE, "resistance_Ohm = 3"))
    assert a.motor.resistance_Ohm == 3.0 and "motor.resistance_Ohm" not in a.tolerances
    a = load_actuator(written(tmp_path, RESISTANCE, "resistance_Ohm = { value = 3.0, sigma = 0.2, free = false }"))
    assert a.tolerances["motor.resistance_Ohm"] == Tolerance(0.2, False)
    a = load_actuator(str(written(tmp_path, 'name = "Thesis EMA"', "")))
    assert a.name == "mine"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("schema = 1", "schema = 2", "schema 2 is not known"),
        ("schema = 1", "schema = ", "not valid TOML"),
        ("[sensors]", "[sensor]", "unknown entry 'sensor'"),
        ("[motor]", "[[motor]]", "[motor] must be a table"),
        (RESISTANCE, "", "[motor] lacks resistance_Ohm"),
        (RESISTANCE, RESISTANCE + "\nrestance_Ohm = 2", "[motor] has no parameter 'restance_Ohm'"),
        (RESISTANCE, 'resistance_Ohm = "2.13"', "[motor] resistance_Ohm must be a number"),
        (RESISTANCE, "resistance_Ohm = true", "must be a number"),
        (RESISTANCE, "resistance_Ohm = nan", "must be a number"),
        (RESISTANCE, "resistance_Ohm = inf", "must be a number"),
        (RESISTANCE, "resistance_Ohm = [2.13]", "must be a number"),
        (RESISTANCE, "resistance_Ohm = 2020-01-01", "must be a number"),
        (RESISTANCE, "resistance_Ohm = 0", "must be above 0"),
        (RESISTANCE, "resistance_Ohm = -2.13", "must be above 0"),
        (RESISTANCE, "resistance_Ohm = { tolerance = 0.05 }", "takes value, tolerance or sigma, free"),
        (RESISTANCE, "resistance_Ohm = { value = 2, tol = 0.05 }", "takes value, tolerance or sigma, free"),
        (RESISTANCE, "resistance_Ohm = { value = 2.1, tolerance = 0 }", "the tolerance must be above 0"),
        (RESISTANCE, "resistance_Ohm = { value = 2.1, tolerance = -0.1 }", "the tolerance must be above 0"),
        (RESISTANCE, "resistance_Ohm = { value = 2.1, tolerance = nan }", "the tolerance must be above 0"),
        (RESISTANCE, 'resistance_Ohm = { value = 2.1, sigma = "x" }', "the tolerance must be above 0"),
        (
            "current_bias_A = { value = 0.0, sigma = 0.02 }",
            "current_bias_A = { value = 0.0, tolerance = 0.02 }",
            "above",
        ),
        ("dynamic_friction_Nm = { value = 0.05067", "dynamic_friction_Nm = { value = -0.05", "must not be negative"),
        ("stop_low_rad = -1.5", "stop_low_rad = 1.5", "stop_low_rad must be below stop_high_rad"),
    ],
)
def test_wrong_file_is_one_clear_line(tmp_path, old, new, message):
    path = written(tmp_path, old, new)
    with pytest.raises(InputError) as error:
        load_actuator(path)
    text = str(error.value)
    assert text.startswith(str(path)) and message in text and "\n" not in text


@pytest.mark.parametrize(
    "entry",
    [
        '{ value = 2.13, tolerance = "5%" }',  # TypeError
        "{ value = 2.13, tolerance = [0.05] }",  # TypeError
        "{ value = 2.13, tolerance = true }",  # read as 100 %
        '{ value = 2.13, tolerance = 0.05, free = "no" }',  # read as free
        "1" + "0" * 400,  # OverflowError
    ],
)
def test_wrong_entry_is_refused(tmp_path, entry):
    with pytest.raises(InputError):
        load_actuator(written(tmp_path, RESISTANCE, f"resistance_Ohm = {entry}"))


@pytest.mark.parametrize("number", ["9" * 5000, "0x" + "f" * 5000])
def test_numbers_of_thousands_of_digits_are_one_line(tmp_path, number):
    for text in (f"[motor]\nresistance_Ohm = {number}", f"schema = {number}", f"[model]\nstep_s = {number}"):
        (tmp_path / "a.toml").write_text(text)
        with pytest.raises(InputError, match=r"digits|must|lacks") as told:
            load_actuator(tmp_path / "a.toml")
        assert len(str(told.value)) < 300 and "\n" not in str(told.value)


def test_an_actuator_file_of_300_MB_is_not_read(tmp_path):
    with open(tmp_path / "a.toml", "wb") as file:
        file.truncate(300_000_000)
    with pytest.raises(InputError, match=r"is 300 MB large, over the limit of 0\.1 MB"):
        load_actuator(tmp_path / "a.toml")


def test_unreadable_files(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        load_actuator(tmp_path / "none.toml")
    with pytest.raises(InputError, match="is a folder"):
        load_actuator(tmp_path)
    latin = tmp_path / "latin.toml"
    latin.write_bytes("name = 'Stellglied für Höhenruder'".encode("latin-1"))
    with pytest.raises(InputError, match="cannot be read as text"):
        load_actuator(latin)


def test_with_values_changes_only_what_is_named():
    a = load_actuator()
    b = a.with_values({"motor.inertia_kgm2": 2e-5, "motor.resistance_Ohm": 3, "sensors.current_bias_A": -0.1})
    changed = {path for path in paths() if a.value(path) != b.value(path)}
    assert changed == {"motor.inertia_kgm2", "motor.resistance_Ohm", "sensors.current_bias_A"}
    assert b.tolerances == a.tolerances and a.motor.inertia_kgm2 == 1.3e-5


@pytest.mark.parametrize(
    "values",
    [
        {"motor.mass_kg": 1.0},
        {"motor": 1.0},
        {"name": 1.0},
        {"motor.inertia_kgm2": 0.0},
        {"motor.inertia_kgm2": float("nan")},
        {"motor.inertia_kgm2": "1e-5"},
        {"motor.static_friction_Nm": -0.1},
        {"transmission.stop_low_rad": 2.0},
    ],
)
def test_with_values_refuses(values):
    with pytest.raises(InputError) as error:
        load_actuator().with_values(values)
    assert "\n" not in str(error.value)
