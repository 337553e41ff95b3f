"""`emaviz discover`: the verdict, its JSON, the improved model, and one clear line for each mistake."""

from __future__ import annotations

import pytest
from support.documents import result_of

from ema_model.actuator import load_actuator
from emaviz.cli import main
from emaviz.recording import read


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """Two recordings with hidden cogging: a sine to fit, a chirp to hold out."""
    folder = tmp_path_factory.mktemp("rig")
    common = ["--effect", "cogging_torque:amplitude_Nm=0.02,order=12", "--noise-current", "0.3", "--encoder-bits", "12"]
    sine = ["--command", "sine", "--set", "amplitude_rad=0.03", "--set", "frequency_Hz=3", "--duration", "0.7"]
    assert main(["simulate", *common, *sine, "--out", str(folder / "sine.csv")]) == 0
    assert main(["simulate", *common, "--seed", "1", "--out", str(folder / "chirp.csv")]) == 0
    return folder


def test_effect_is_found_and_the_model_saved(rig, tmp_path, capsys):
    out, better = tmp_path / "d.json", tmp_path / "better.toml"
    held = ["--holdout", str(rig / "chirp.csv")]
    arguments = [*held, "--json", str(out), "--save-actuator", str(better), "--max-effects", "1"]
    assert main(["discover", str(rig / "sine.csv"), *arguments]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("effects found") and "error ladder" in printed and "+ Cogging torque" in printed
    result = result_of(out, "discover")
    assert result["schema"] == 1 and result["verdict"] == "effects_found"
    assert [one["name"] for one in result["effects"]] == ["cogging_torque"]
    assert result["ladder"][-1]["holdout_rmse"] < result["ladder"][0]["holdout_rmse"]
    model = load_actuator(better)
    low, high = result["effects"][0]["parameters"]["amplitude_Nm"]["interval90"]
    assert model.effects["cogging_torque"]["order"] == 12.0
    sigma = model.tolerances["effects.cogging_torque.amplitude_Nm"].sigma
    assert sigma == pytest.approx((high - low) / 2 / 1.645, rel=1e-3)
    saved, last = result["saved_actuator"], result["ladder"][-1]
    assert saved["file"] == str(better) and saved["verified_rmse"] == pytest.approx(last["rmse"], rel=0.01)
    assert saved["verified_holdout_rmse"] == pytest.approx(last["holdout_rmse"], rel=0.01)
    assert f"saved {better}, verified: " in printed and "worse" not in printed
    assert main(["compare", str(rig / "chirp.csv"), "--actuator", str(better), "--json", str(out)]) == 0
    assert result_of(out, "compare")["adequate"] is True


@pytest.mark.long
def test_recording_and_report_tell_the_same(rig, tmp_path):
    record, report, out = tmp_path / "d.rrd", tmp_path / "d.html", tmp_path / "d.json"
    arguments = ["--max-effects", "1", "--record", str(record), "--report", str(report), "--json", str(out)]
    assert main(["discover", str(rig / "sine.csv"), *arguments]) == 0
    result, recording = result_of(out, "discover"), read(record)
    told = recording.properties["discovery"]
    assert told["ladder"] == result["ladder"] and told["effects"] == result["effects"]
    assert "sine.csv" in recording.config
    text = report.read_text(encoding="utf-8")
    assert "The model lacks cogging torque." in text and f"{result['ladder'][-1]['rmse']:.3f}" in text


@pytest.mark.parametrize(
    "arguments, says",
    [
        (["missing.csv"], "missing.csv: no such file"),
        (["SINE", "--holdout", "missing.csv"], "missing.csv: no such file"),
        (["SINE", "--signals", "some"], "--signals"),
        (["SINE", "--max-effects", "many"], "--max-effects"),
        (["SINE", "--save-actuator", "nowhere/a.toml"], "the folder nowhere does not exist"),
        (["SINE", "--report", "nowhere/a.html"], "the folder nowhere does not exist"),
        (["SINE", "--record", "nowhere/a.rrd"], "the folder nowhere does not exist"),
        (["SINE", "--record", "a.html"], "must end in .rrd"),
        (["SINE", "--map", "x=y"], "no signal 'x'"),
        (["SINE", "--from", "5"], "no sample lies in the chosen window"),
    ],
)
def test_each_mistake_is_one_clear_line(rig, tmp_path, monkeypatch, capsys, arguments, says):
    monkeypatch.chdir(tmp_path)
    given = [str(rig / "sine.csv") if argument == "SINE" else argument for argument in arguments]
    assert main(["discover", *given]) == 2
    said = capsys.readouterr().err
    assert says in said and said.count("\n") == 1 and "Traceback" not in said
