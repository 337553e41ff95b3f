"""`emaviz compare`: its JSON, report and recording, and one clear line for each mistake."""

from __future__ import annotations

import numpy as np
import pytest
from support.documents import result_of
from support.two_clocks import write_two_clocks

from ema_model.actuator import load_actuator
from ema_model.files.opened import shipped_folder
from ema_model.recordings.read import read_measurement
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


SCREW = str(shipped_folder("actuators") / "ball_screw.toml")
LINEAR = "the actuator's is linear; take an actuator of that axis, or correct [axes] in the actuator's file"
ROTARY = LINEAR.replace("linear", "rotary")
WITHOUT = "…; where no command was recorded, add --open-loop to compare or discover, or choose an actuator with"
MAPPING = ["time_s=t[ms]", "command_rad=set[deg]", "motor_position_rad=motor", "current_A=iq[mA]"]


def test_everything_is_written(rig, tmp_path, capsys):
    out, report, record = tmp_path / "r.json", tmp_path / "r.html", tmp_path / "r.rrd"
    arguments = ["--json", str(out), "--report", str(report), "--record", str(record), "--seed", "7"]
    assert main(["compare", str(rig[0]), *arguments]) == 0
    printed = capsys.readouterr().out
    first, second = printed.splitlines()[:2]
    assert first.startswith("What is missing repeats 12 times a turn")
    assert "of the residual equivalent current variance is explained by motor angle (cross-validated)" in second
    assert "calibration converged" in printed
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
    other = tmp_path / "own.csv"
    rows = np.genfromtxt(rig[0], delimiter=",", names=True, deletechars="")[1:]  # the same run, seen a sample later
    np.savetxt(other, rows, delimiter=",", header=",".join(rows.dtype.names), comments="", fmt="%.10g")
    held = ["--holdout", str(other), "--free", "motor.inertia_kgm2"]
    assert main(["compare", str(rig[0]), *held, "--to", "0.5", *kept]) == 0
    result = result_of(out, "compare")
    (one,) = result["holdout"]
    assert one["name"] == "own" and len(result["recordings"]) == 1
    fitted = result["signals"]["current_A"]
    assert one["signals"]["current_A"]["rmse"] == pytest.approx(fitted["rmse"], rel=0.2)
    line = "own was not fitted; the calibrated model is off by: equivalent current "
    assert line in capsys.readouterr().out and line in report.read_text(encoding="utf-8")
    inertia = result["calibration"]["parameters"]["motor.inertia_kgm2"]
    saved, (low, high) = load_actuator(model), inertia["interval90"]
    assert saved.value("motor.inertia_kgm2") == inertia["value"] != inertia["initial"]
    assert saved.tolerances["motor.inertia_kgm2"].sigma == pytest.approx((high - low) / 2 / 1.645, rel=1e-4)
    unfitted = {path: one for path, one in load_actuator().tolerances.items() if path != "motor.inertia_kgm2"}
    assert {path: saved.tolerances[path] for path in unfitted} == unfitted


MEANT = "; did you mean {!r}?".format


@pytest.mark.parametrize(
    ("rename", "arguments", "says"),
    [
        ({"time_s": "t"}, ["--map", "time_s=tt"], MEANT("t")),
        ({"current_A": "iq_meas"}, ["--map", "current_A=iq_measured[A]"], MEANT("iq_meas")),
        ({}, ["--map", "motor_sped_rad_s=x"], MEANT("motor_speed_rad_s")),
        ({}, ["--signal", "curent_A"], MEANT("current_A")),
        ({"current_A": "serial"}, ["--by", "seriel"], MEANT("serial")),
        ({}, ["--actuator", SCREW], f"the recording's axis is rotary, as command_rad says, and {LINEAR}"),
        (
            {"time_s": "t [s]"},
            ["--actuator", SCREW],
            f"the recording's axis is rotary, as command_rad says, and {LINEAR}",
        ),
        ({"command_rad": "command_m"}, [], f"the recording's axis is linear, as command_m says, and {ROTARY}"),
        ({"command_rad": ""}, [], f"command_rad is needed; add it (present: time_s, {WITHOUT}"),
        ({"command_rad": "", "time_s": "t [s]"}, [], f"command_rad is needed; say which column it is: {WITHOUT}"),
    ],
)
def test_a_line_says_what_was_meant_and_what_to_do(rig, tmp_path, capsys, rename, arguments, says):
    rows = np.genfromtxt(rig[0], delimiter=",", names=True, deletechars="")[:200]
    columns = {rename.get(name, name): rows[name] for name in rows.dtype.names if rename.get(name, name)}
    path = tmp_path / "a.csv"
    np.savetxt(path, np.column_stack([*columns.values()]), delimiter=",", header=",".join(columns), comments="")
    assert main(["compare", str(path), *arguments]) == 2
    said = capsys.readouterr().err
    for part in says.split("…"):
        assert part in said
    assert said.count("\n") == 1


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
