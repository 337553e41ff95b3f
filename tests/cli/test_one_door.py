"""Whichever way a recording comes in, it is the same: compare, discover, identify, --command, and the page."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from support.on_page import wait_until

from ema_model import comparison, discovery
from ema_model.actuator import load_actuator, shipped
from ema_model.commands import command
from ema_model.identification import search
from ema_model.quantities import amount
from ema_model.recordings import Measurement, read, write_measurement
from ema_model.simulation import run as simulating
from ema_model.simulation.run import Run, simulate_reference
from emaviz.cli import main
from emaviz.session.compare import Comparing
from emaviz.session.data_folder import DataFolder
from emaviz.session.discovery_source import DiscoverySource
from emaviz.session.explore import Session

BALL_SCREW = """
name = "Ball screw"
[axes]
motor = "linear"
user = "linear"
[controller]
position_gain_1_s = 25.0
speed_limit_m_s = 0.637
speed_gain_Ns_m = 7106.0
integral_gain_N_m = 236900.0
derivative_gain_Ns2_m = 0.0
integrator_window_m = 1.0
force_constant_N_A = 251.3
current_limit_A = 4.0
[inverter]
kind = "current"
current_limit_A = 4.0
[motor]
force_constant_N_A = { value = 251.3, tolerance = 0.04 }
force_limit_N = 1005.0
mass_kg = { value = 54.0, tolerance = 0.08 }
viscous_friction_Ns_m = { value = 160.0, tolerance = 0.3 }
static_friction_N = 0.0
dynamic_friction_N = { value = 70.0, tolerance = 0.15 }
[transmission]
gear_ratio = 1.0
backlash_m = 0.0
viscous_friction_Ns_m = 0.0
stop_low_m = -0.2
stop_high_m = 0.2
"""
GERMAN = {  # header: signal, and SI of one
    "Zeit [ms]": ("time_s", 1e-3),
    "Sollwinkel [°]": ("command_rad", np.pi / 180.0),
    "Abtriebswinkel [°]": ("user_position_rad", np.pi / 180.0),
    "Motorwinkel [°]": ("motor_position_rad", np.pi / 180.0),
    "Motordrehzahl [1/min]": ("motor_speed_rad_s", np.pi / 30.0),
    "iq [mA]": ("current_A", 1e-3),
}
KINDS = ("phases", "linear", "german")
WAYS = ("compare", "discover", "identify", "command", "page", "page identify", "page discover")


@pytest.fixture(scope="module")
def run():
    return simulate_reference(Run(command("chirp", {}), 0.4), load_actuator())


@pytest.fixture(scope="module")
def rig(run, tmp_path_factory):
    """A folder with a recording and an actuator of each kind."""
    folder = tmp_path_factory.mktemp("rig")
    for kind in KINDS:
        text = BALL_SCREW if kind == "linear" else shipped("thesis.toml")
        (folder / f"{kind}_actuator.toml").write_text(text, encoding="utf-8")
    phases = {name: values for name, values in run.signals.items() if name != "current_A"}
    write_measurement(Measurement(phases), folder / "phases.csv")
    time = np.linspace(0.0, 0.5, 501)
    way = 0.02 * np.sin(9.0 * time)
    names = ("command_m", "motor_position_m", "user_position_m")
    linear = {"time_s": time, **dict.fromkeys(names, way), "current_A": np.cos(9.0 * time)}
    write_measurement(Measurement(linear), folder / "linear.csv")
    table = np.column_stack([run[signal] / si for signal, si in GERMAN.values()])
    rows = "\n".join(";".join(f"{value:.12g}" for value in row).replace(".", ",") for row in table)
    (folder / "german.csv").write_text(f"{';'.join(GERMAN)}\n{rows}\n", encoding="utf-8")
    return folder


class Seen(Exception):
    """What came in; ends the command there."""


def on_command_line(name, module, function, monkeypatch, *arguments):
    """What the command hands to the model."""

    def look(given, *_, **__):
        raise Seen(given)

    monkeypatch.setattr(module, function, look)
    with pytest.raises(Seen) as seen:
        main([name, *map(str, arguments)])
    return seen.value.args[0]


def on_page(way, path, actuator_file, tmp_path):
    """The same on the page: its columns as proposed."""
    data = DataFolder(tmp_path / "data")
    session = Session(load_actuator(actuator_file), data.recordings)
    comparing = Comparing(session, data)
    try:
        name = data.name_of(data.take_in(path))
        if way == "page identify":
            return comparing.measurement(name)
        comparing.add(name)
        wait_until(lambda: name in comparing.opened)
        if comparing.opened[name].measurement is None:
            comparing.use_mapping(name, comparing.opened[name].mapping)
            wait_until(lambda: comparing.opened[name].measurement is not None)
        if way == "page":
            measurement = comparing.opened[name].measurement
            assert measurement is not None
            return measurement
        source = DiscoverySource(comparing)
        return source.read(source.recipe()).fitted[0]
    finally:
        comparing.close()
        session.close()


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", KINDS)
def test_the_same_comes_in_by_every_way(kind, way, rig, tmp_path, monkeypatch):
    path, actuator_file = rig / f"{kind}.csv", rig / f"{kind}_actuator.toml"
    expected = read(path, load_actuator(actuator_file))
    asked = ("--actuator", actuator_file)
    if way.startswith("page"):
        found = on_page(way, path, actuator_file, tmp_path)
    elif way == "command":
        out = tmp_path / "out.csv"
        function = "simulate_monitor" if kind == "linear" else "simulate_reference"
        model = ("--model", "mm" if kind == "linear" else "rm")
        run = on_command_line(
            "simulate", simulating, function, monkeypatch, "--command", path, "--out", out, *asked, *model
        )
        assert np.array_equal(run.command.command_rad, expected["command_rad"])
        assert np.array_equal(run.command.time_s, expected.time_s)
        return
    else:
        module = {"compare": comparison, "discover": discovery, "identify": search}[way]
        function = "Objective" if way == "identify" else way
        (found,) = on_command_line(way, module, function, monkeypatch, path, *asked)
    assert set(found.signals) == set(expected.signals)
    for name, values in expected.signals.items():
        assert np.array_equal(found[name], values), name


def test_the_arrays_are_what_the_model_needs(rig, run):
    phases = read(rig / "phases.csv", load_actuator())
    np.testing.assert_allclose(phases["current_A"], run["current_A"], atol=0.05)
    assert phases.reading.made == ("current_A",)
    linear = read(rig / "linear.csv", load_actuator(rig / "linear_actuator.toml"))
    assert "command_m" not in linear and linear["command_rad"][100] == pytest.approx(0.02 * np.sin(0.9))
    german = read(rig / "german.csv", load_actuator())
    for name in ("command_rad", "motor_speed_rad_s", "current_A"):
        np.testing.assert_allclose(german[name], run[name], atol=1e-9)


def test_a_line_says_what_was_assumed_and_canonical_names_are_silent(rig, tmp_path, monkeypatch, capsys):
    on_command_line("identify", search, "Objective", monkeypatch, rig / "german.csv")
    told = capsys.readouterr().err
    assert told.startswith("german.csv: time_s from Zeit [ms], command_rad from Sollwinkel [°], ")
    assert "motor_speed_rad_s from Motordrehzahl [1/min], current_A from iq [mA]\n" in told and told.count("\n") == 1
    on_command_line("identify", search, "Objective", monkeypatch, rig / "phases.csv")
    assert capsys.readouterr().err == ""


UNSURE = {  # header: what the refusal says, and the options that make it clear
    "t [s];set [deg];pos [deg];iq": ("'iq' may be current_A, but it has no unit", ["current_A=iq[A]"]),
    "t [s];set;motor angle [deg];iq [A]": ("'set' may be command_rad, but it has no unit", ["command_rad=set[rad]"]),
    "t [s];set [deg];iq 1 [A];iq 2 [A]": (
        "'iq 1 [A]' may be current_A, but 'iq 2 [A]' may be it as well",
        ["current_A=iq 1 [A]"],
    ),
    "t [s];flow;pos [deg];iq [A]": ("command_rad is needed", ["command_rad=COLUMN[rad]"]),
}


@pytest.mark.parametrize("header", UNSURE)
def test_what_is_unsure_is_asked_for_with_an_option_to_copy(header, tmp_path, capsys, monkeypatch):
    says, options = UNSURE[header]
    count = np.arange(200.0)
    path = tmp_path / "log.csv"
    columns = [1e-3 * count, np.sin(count / 30.0), np.sin(count / 30.0), np.cos(count / 30.0)]
    np.savetxt(path, np.column_stack(columns), delimiter=";", header=header, comments="")
    assert main(["identify", str(path)]) == 2
    told = capsys.readouterr().err
    assert says in told and told.count("\n") == 1
    assert all(column.split(" [")[0] in told for column in header.split(";"))
    for option in options:
        assert f"--map '{option}'" in told
    if "COLUMN" in options[0]:
        options = ["command_rad=flow[rad]"]
    given = [part for option in options for part in ("--map", option)]
    (found,) = on_command_line("identify", search, "Objective", monkeypatch, path, *given)
    assert np.array_equal(found["time_s"], read(path, load_actuator(), options).time_s)


def test_what_is_not_needed_and_unsure_is_left_aside_and_said(tmp_path, capsys, monkeypatch):
    count = np.arange(200.0)
    path = tmp_path / "log.csv"
    header = "time_s,command_rad,current_A,speed"
    np.savetxt(path, np.column_stack([1e-3 * count, count, -count, count]), delimiter=",", header=header, comments="")
    (found,) = on_command_line("compare", comparison, "compare", monkeypatch, path)
    assert set(found) == {"time_s", "command_rad", "current_A"}
    assert capsys.readouterr().err == "log.csv: left aside: speed (it has no unit)\n"


def test_a_side_file_is_not_guessed_over(tmp_path, capsys, monkeypatch):
    count = np.arange(200.0)
    path = tmp_path / "log.csv"
    header = "t,set,iq,speed [rpm]"
    np.savetxt(path, np.column_stack([1e-3 * count, count, -count, count]), delimiter=",", header=header, comments="")
    path.with_suffix(".toml").write_text(
        'schema = 1\n[mapping]\ntime_s = "t[s]"\ncommand_rad = "set[deg]"\ncurrent_A = "iq[A]"\n', encoding="utf-8"
    )
    (found,) = on_command_line("compare", comparison, "compare", monkeypatch, path)
    assert set(found) == {"time_s", "command_rad", "current_A"} and capsys.readouterr().err == ""
    assert {entry.signal for entry in found.reading.mapping.entries} == set(found)


def test_identify_takes_what_compare_takes_and_shares_its_options(rig, tmp_path, capsys):
    out, report, model = tmp_path / "r.json", tmp_path / "r.html", tmp_path / "fitted.toml"
    quick = ["--population", "4", "--iterations", "2", "--from", "0", "--to", "0.35", "--json", str(out)]
    kept = ["--report", str(report), "--save-actuator", str(model), "--holdout", str(rig / "german.csv")]
    assert main(["identify", str(rig / "phases.csv"), *quick, *kept]) == 0
    result = json.loads(out.read_text())
    assert result["healthy"] is True and 0.0 < result["holdout_rmse"] < 3.0
    assert re.search("on what was not fitted, .* on what was: german", capsys.readouterr().out)
    fitted = load_actuator(model)
    assert result["parameters"] and fitted.value("motor.inertia_kgm2") == result["parameters"]["motor.inertia_kgm2"]
    text = report.read_text(encoding="utf-8")
    numbers = (f"{result['k'][7]:.4f}", amount(result["holdout_rmse"], "A"))
    assert all(told in text for told in ("Faults", "friction factor", "Convergence", *numbers))


@pytest.mark.long
def test_a_simulated_linear_axis_is_read_again(rig, tmp_path):
    """What `simulate` writes has the names of the axis, and --command and `compare` take it back."""
    asked = ["--actuator", str(rig / "linear_actuator.toml")]
    first, second, out = tmp_path / "first.csv", tmp_path / "second.csv", tmp_path / "r.json"
    made = ["simulate", "--model", "mm", "--noise-current", "0.01", *asked, "--out"]
    sine = ["--command", "sine", "--set", "amplitude_rad=0.01", "--set", "frequency_Hz=2"]
    assert main([*made, str(first), *sine]) == 0
    assert first.read_text(encoding="utf-8").startswith("time_s,command_m,user_position_m")
    assert main([*made, str(second), "--command", str(first)]) == 0
    assert main(["compare", str(second), *asked, "--no-calibrate", "--json", str(out)]) == 0
    assert json.loads(out.read_text())["signals"]["motor_position_m"]["rmse"] < 1e-5


def test_no_other_door_is_used():
    found = subprocess.run(
        ["grep", "-rnE", r"read_measurement|recordings\.file import|read_recording", "emaviz", "--include=*.py"],
        capture_output=True,
        text=True,
        cwd=Path(__file__).parents[2],
    )
    assert found.stdout == ""
