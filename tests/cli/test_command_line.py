"""The command line: results and their JSON, and one clear line for each mistake."""

from __future__ import annotations

import socket
import subprocess
import sys

import numpy as np
import pytest
from support.documents import result_of

from ema_model.recordings.file import read_measurement
from emaviz.cli import main


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("cli") / "friction.csv"
    assert main(["simulate", "--fault", "k1=0.25", "--noise-current", "0.1", "--out", str(path)]) == 0
    return path


def test_simulate_writes_the_measurement_format(recording):
    measurement = read_measurement(recording)
    for name in (
        "time_s command_rad user_position_rad motor_position_rad motor_speed_rad_s current_A phase_a_current_A "
        "phase_b_current_A phase_c_current_A"
    ).split():
        assert name in measurement
    assert measurement.samples == 5001
    assert measurement.sample_period_s == pytest.approx(1e-4)


def test_simulate_is_reproducible_by_seed(tmp_path):
    def run(seed, name):
        path = tmp_path / name
        arguments = ["simulate", "--model", "mm", "--noise-current", "0.4", "--encoder-bits", "12"]
        assert main([*arguments, "--seed", str(seed), "--out", str(path)]) == 0
        return read_measurement(path)["current_A"]

    first = run(1, "a.parquet")
    assert np.array_equal(first, run(1, "b.csv"))
    assert not np.array_equal(first, run(2, "c.csv"))


@pytest.mark.parametrize("model", ["rm", "mm"])
def test_effects_act_in_both_models(tmp_path, model):
    plain, rippled = tmp_path / "plain.csv", tmp_path / "cogging.csv"
    assert main(["simulate", "--model", model, "--out", str(plain)]) == 0
    effect = "cogging_torque:amplitude_Nm=0.024,order=12"
    assert main(["simulate", "--model", model, "--effect", effect, "--out", str(rippled)]) == 0
    difference = read_measurement(rippled)["current_A"] - read_measurement(plain)["current_A"]
    assert 0.1 < np.sqrt(np.mean(difference**2)) < 1.0


def test_identify_finds_the_fault_of_a_file(recording, tmp_path, capsys):
    out = tmp_path / "result.json"
    assert main(["identify", str(recording), "--algorithm", "do", "--json", str(out), "--seed", "3"]) == 0
    result = result_of(out, "identify")
    assert result["schema"] == 1 and result["seed"] == 3
    assert set(result["versions"]) == {"emaviz", "numpy", "numba"}
    assert abs(result["k"][0] - 0.25) < 0.02
    assert result["alarms"] and "k1" in result["alarms"] and result["healthy"] is False
    assert len(result["k_interval90"]) == 8 and len(result["history"]["rmse"]) == 151
    assert result["physical"]["friction_factor"] == pytest.approx(1.5, abs=0.05)
    assert "friction × 1." in capsys.readouterr().out


def test_identify_with_faults_tells_the_error(tmp_path):
    out = tmp_path / "result.json"
    arguments = ["identify", "--fault", "k3=0.25", "--algorithm", "do", "--json", str(out)]
    assert main(arguments) == 0
    assert result_of(out, "identify")["error_percent"] < 0.6


def test_effects_lists_and_explains(capsys):
    assert main(["effects"]) == 0
    assert "stribeck_friction" in capsys.readouterr().out
    assert main(["effects", "cogging_torque"]) == 0
    assert "amplitude_Nm" in capsys.readouterr().out


BAD = {
    "missing file": ["identify", "nothing-here.csv"],
    "folder": ["identify", "."],
    "no such fault": ["identify", "--fault", "k9=0.1"],
    "fault outside": ["identify", "--fault", "k1=1.5"],
    "fault is text": ["identify", "--fault", "k1=much"],
    "fault is nan": ["identify", "--fault", "k1=nan"],
    "no such algorithm": ["identify", "--algorithm", "magic"],
    "population": ["identify", "--population", "0"],
    "population text": ["identify", "--population", "many"],
    "iterations": ["identify", "--iterations", "0"],
    "no such command": ["simulate", "--command", "wiggle", "--out", "x.csv"],
    "no such setting": ["simulate", "--set", "colour=3", "--out", "x.csv"],
    "setting is text": ["simulate", "--set", "end_Hz=fast", "--out", "x.csv"],
    "setting without value": ["simulate", "--set", "end_Hz", "--out", "x.csv"],
    "zero sweep": ["simulate", "--set", "end_time_s=0", "--out", "x.csv"],
    "duration": ["simulate", "--duration", "-1", "--out", "x.csv"],
    "duration nan": ["simulate", "--duration", "nan", "--out", "x.csv"],
    "load": ["simulate", "--load-torque", "inf", "--out", "x.csv"],
    "sample rate": ["simulate", "--sample-rate", "0", "--out", "x.csv"],
    "noise": ["simulate", "--noise-current", "-1", "--out", "x.csv"],
    "encoder": ["simulate", "--encoder-bits", "99", "--out", "x.csv"],
    "no such effect": ["simulate", "--effect", "magic", "--out", "x.csv"],
    "effect setting": ["simulate", "--effect", "cogging_torque:colour=1", "--out", "x.csv"],
    "effect range": ["simulate", "--effect", "cogging_torque:order=1.5", "--out", "x.csv"],
    "no out": ["simulate"],
    "out suffix": ["simulate", "--out", "x.docx"],
    "out folder": ["simulate", "--out", "no/such/folder/x.csv"],
    "json folder": ["effects", "--json", "no/such/folder/x.json"],
    "actuator": ["identify", "--actuator", "none.toml"],
    "view missing": ["view", "none.rrd"],
    "unknown option": ["simulate", "--colour", "red"],
    "gui port": ["gui", "--port", "99999", "--no-open"],
    "unknown word": ["recognise"],
}


@pytest.mark.parametrize("arguments", BAD.values(), ids=BAD.keys())
def test_a_mistake_is_one_line_and_exit_code_2(arguments, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    told = capsys.readouterr().err
    assert told.startswith("emaviz: ") and told.count("\n") == 1, told
    assert not (tmp_path / "x.csv").exists()


def test_a_taken_port_is_told(capsys, tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert main(["gui", "--port", str(port), "--no-open", "--data-dir", str(tmp_path)]) == 2
    assert f"port {port} is in use" in capsys.readouterr().err


def test_the_model_core_imports_no_screen():
    code = "import sys, ema_model.identification.run; print(sorted({'viser', 'rerun', 'emaviz'} & set(sys.modules)))"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == "[]"
