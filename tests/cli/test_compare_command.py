"""`emaviz compare`: its JSON, report and recording, and one clear line for each mistake."""

from __future__ import annotations

import numpy as np
import pytest
from support.documents import result_of
from support.two_clocks import write_two_clocks

from ema_model.actuator import load_actuator
from ema_model.recordings.file import read_measurement
from emaviz.cli import main
from emaviz.recording import read


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """A recording with hidden cogging under the names and in the units of a rig."""
    folder = tmp_path_factory.mktemp("rig")
    path = folder / "own.csv"
    effect = ["--effect", "cogging_torque:amplitude_Nm=0.02,order=12", "--noise-current", "0.2", "--encoder-bits", "12"]
    sine = ["--command", "sine", "--set", "amplitude_rad=0.03", "--set", "frequency_Hz=3", "--duration", "1"]
    assert main(["simulate", *effect, *sine, "--out", str(path)]) == 0
    own = read_measurement(path)
    foreign = folder / "foreign.csv"
    columns = {
        "t[ms]": 1e3 * own.time_s,
        "set": np.rad2deg(own["command_rad"]),
        "motor": own["motor_position_rad"],
        "iq": 1e3 * own["current_A"],
    }
    table = np.column_stack(list(columns.values()))
    np.savetxt(foreign, table, delimiter=",", header=",".join(columns), comments="", fmt="%.10g")
    return path, foreign


MAPPING = ["time_s=t[ms]", "command_rad=set[deg]", "motor_position_rad=motor", "current_A=iq[mA]"]


def test_everything_is_written(rig, tmp_path, capsys):
    out, report, record = tmp_path / "r.json", tmp_path / "r.html", tmp_path / "r.rrd"
    arguments = ["--json", str(out), "--report", str(report), "--record", str(record), "--seed", "7"]
    assert main(["compare", str(rig[0]), *arguments]) == 0
    printed = capsys.readouterr().out
    first = printed.splitlines()[0]
    assert "of the residual equivalent current variance is explained by motor angle (cross-validated)" in first
    assert "12 times a turn" in printed and "calibration converged" in printed
    result = result_of(out, "compare")
    assert result["schema"] == 1 and result["seed"] == 7 and result["adequate"] is False
    assert result["explained_by"][0]["variable"] == "motor_angle" and result["orders"][0]["order"] == 12
    assert result["calibration"]["converged"] and result["worst_regions"][0]["sentence"]
    assert result["signals"]["current_A"]["rmse"] > result["signals"]["current_A"]["noise_floor"]
    assert report.stat().st_size > 1e6 and "12 times a turn" in report.read_text(encoding="utf-8")
    assert set(read(record).signals) >= {"measurement", "monitor", "residual"}


def test_foreign_columns_are_mapped(rig, tmp_path):
    out = tmp_path / "r.json"
    mapping = [part for text in MAPPING for part in ("--map", text)]
    assert main(["compare", str(rig[1]), *mapping, "--json", str(out)]) == 0
    result = result_of(out, "compare")
    assert set(result["signals"]) == {"current_A", "motor_position_rad"}
    assert result["explained_by"][0]["variable"] == "motor_angle"


def test_a_late_clock_is_told_and_taken_out(rig, tmp_path):
    """The delay stands in the card's numbers with its interval, and the option that the card names takes it out."""
    path, out = tmp_path / "two.csv", tmp_path / "r.json"
    write_two_clocks(path, read_measurement(rig[0]), 0.005)
    found = []
    for more in ([], ["--map", "motor_speed_rad_s=motor_speed_rad_s[delay_s=0.005]"]):
        assert main(["compare", str(path), "--no-calibrate", "--to", "0.5", *more, "--json", str(out)]) == 0
        findings = result_of(out, "compare")["recordings"][0]["health"]["findings"]
        found.append(next(one for one in findings if one["check"] == "speed_delay"))
    late, moved = found
    assert late["values"]["delay_low_s"] <= 0.005 <= late["values"]["delay_high_s"] and late["severity"] == "warning"
    assert "delay_s=0.005" in late["sentence"] and "90 % interval" in late["sentence"]
    assert moved["values"]["delay_low_s"] <= 0.0 <= moved["values"]["delay_high_s"] and moved["severity"] == "good"


def test_options_reach_the_comparison(rig, tmp_path):
    out = tmp_path / "r.json"
    choice = ["--free", "motor.inertia_kgm2", "--signal", "current_A=2", "--from", "0.2", "--to", "0.7"]
    assert main(["compare", str(rig[0]), *choice, "--json", str(out)]) == 0
    result = result_of(out, "compare")
    assert set(result["calibration"]["parameters"]) == {"motor.inertia_kgm2"}
    assert main(["compare", str(rig[0]), "--no-calibrate", "--json", str(out)]) == 0
    assert result_of(out, "compare")["calibration"] is None
    added = ["--effect", "cogging_torque:amplitude_Nm=0.02,order=12"]
    assert main(["compare", str(rig[0]), *added, "--json", str(out)]) == 0
    assert result_of(out, "compare")["adequate"] is True


def test_held_out_recordings_judge_the_calibrated_model_which_is_saved(rig, tmp_path, capsys):
    out, report, model = tmp_path / "r.json", tmp_path / "r.html", tmp_path / "calibrated.toml"
    kept = ["--save-actuator", str(model), "--report", str(report), "--json", str(out)]
    held = ["--holdout", str(rig[0]), "--free", "motor.inertia_kgm2"]
    assert main(["compare", str(rig[0]), *held, "--to", "0.5", *kept]) == 0
    result = result_of(out, "compare")
    (one,) = result["holdout"]
    assert one["name"] == "own" and len(result["recordings"]) == 1
    fitted = result["signals"]["current_A"]
    assert one["signals"]["current_A"]["rmse"] == pytest.approx(fitted["rmse"], rel=0.2)
    line = "own was not fitted; the calibrated model is off by: equivalent current "
    assert line in capsys.readouterr().out and line in report.read_text(encoding="utf-8")
    inertia = result["calibration"]["parameters"]["motor.inertia_kgm2"]
    assert load_actuator(model).value("motor.inertia_kgm2") == inertia["value"] != inertia["initial"]


@pytest.mark.parametrize(
    "arguments, says",
    [
        (["missing.csv"], "missing.csv: no such file"),
        ([], "FILE"),
        (["OWN", "--actuator", "nowhere.toml"], "nowhere.toml: no such file"),
        (["OWN", "--map", "current=iq"], "no signal 'current'"),
        (["OWN", "--map", "current_A=iq"], "no column 'iq' for current_A"),
        (["OWN", "--map", "nonsense"], "signal=column"),
        (["FOREIGN"], "'set' may be command_rad, but it has no unit"),
        (["FOREIGN", "--map", "command_rad=set[deg]"], "--map 'current_A=iq[A]'"),
        (["OWN", "--holdout", "missing.csv"], "missing.csv: no such file"),
        (["OWN", "--save-actuator", "a.txt"], "must end in .toml"),
        (["OWN", "--save-actuator", "a.toml", "--no-calibrate"], "leave --no-calibrate out"),
        (["OWN", "--free", "motor.colour"], "motor.colour cannot be calibrated"),
        (["OWN", "--fault", "k9=1"], "k9"),
        (["OWN", "--effect", "rust"], "no effect 'rust'"),
        (["OWN", "--signal", "speed"], "no signal 'speed'"),
        (["OWN", "--signal", "current_A=-1"], "must be a number above 0"),
        (["OWN", "--from", "5"], "no sample lies in the chosen window"),
        (["OWN", "--from", "0.1", "--to", "0.101"], "too short"),
        (["OWN", "--json", "nowhere/r.json"], "the folder nowhere does not exist"),
        (["OWN", "--report", "nowhere/r.html"], "the folder nowhere does not exist"),
        (["OWN", "--record", "nowhere/r.txt"], ".rrd"),
    ],
)
def test_each_mistake_is_one_clear_line(rig, tmp_path, monkeypatch, capsys, arguments, says):
    monkeypatch.chdir(tmp_path)
    given = [{"OWN": str(rig[0]), "FOREIGN": str(rig[1])}.get(argument, argument) for argument in arguments]
    assert main(["compare", *given]) == 2
    said = capsys.readouterr().err
    assert says in said and said.count("\n") == 1 and "Traceback" not in said
