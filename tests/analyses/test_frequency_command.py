"""`emaviz frequency`: its outputs, what is refused in one line, and the recording that the Rerun viewer opens."""

from __future__ import annotations

import json
import re

import pytest
from rerun.chunk import RrdReader
from support.documents import result_of
from support.flexible_drive import flexible_drive
from support.unknown_drive import drive_of

from ema_model.recordings import write_measurement
from emaviz.cli import main


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("rig")
    drive_of(made, False)
    write_measurement(flexible_drive(3, 22.0), made / "sweep.csv")
    return made


def test_all_outputs(folder, tmp_path, capsys):
    written = [tmp_path / name for name in ("r.json", "r.html", "r.rrd")]
    options = [str(text) for pair in zip(("--json", "--report", "--record"), written) for text in pair]
    given = ["frequency", str(folder / "sweep.csv"), "--actuator", str(folder / "motor.toml")]
    assert main([*given, "--input", "current", *options]) == 0
    told = capsys.readouterr().out
    assert told.startswith("The measured resonance lies at 38.1") and "antiresonance [Hz]" in told
    found = result_of(written[0], "frequency")
    assert found["input"] == "current_A" and found["output"] == "motor_position_rad" and found["reason"] is None
    assert found["configuration"]["input"] == "current"
    assert found["measured"]["resonance"]["frequency_Hz"]["value"] == pytest.approx(38.1, rel=0.02)
    assert found["answer"][0] == told.splitlines()[0]
    page = written[1].read_text()
    headings = re.findall(r"<h2>(.*?)</h2>", page)
    assert headings == ["The answer", "Bode plot", "Coherence"] and page.count("data-figure=") == 3
    entities = {str(chunk.entity_path) for chunk in RrdReader(written[2]).stream()}
    assert {"/answer", "/frequency/bode/figure_1/grid", "/frequency/coherence/figure_1/grid"} <= entities
    assert any(one.startswith("/frequency/bode/figure_2/line_") for one in entities)


def test_a_step_is_one_honest_line(tmp_path, capsys):
    run = tmp_path / "step.csv"
    assert main(["simulate", "--command", "step", "--duration", "2", "--model", "mm", "--out", str(run)]) == 0
    capsys.readouterr()
    assert main(["frequency", str(run), "--json", str(tmp_path / "s.json"), "--report", str(tmp_path / "s.html")]) == 0
    told = capsys.readouterr().out
    assert told.startswith("No frequency response is told: the input moves once or twice only, as steps do")
    found = result_of(tmp_path / "s.json", "frequency")
    assert found["measured"] is None and found["frequency_Hz"] == [] and "steps" in found["reason"]
    page = (tmp_path / "s.html").read_text()
    assert re.findall(r"<h2>(.*?)</h2>", page) == ["The answer"] and "data-figure=" not in page


def test_what_is_wrong_is_one_line(folder, capsys):
    given = ["frequency", str(folder / "sweep.csv"), "--actuator", str(folder / "motor.toml")]
    for more, words in (
        (["--output", "user"], "user_position_rad is needed"),
        (["--input", "sped"], "is none of auto"),
    ):
        assert main([*given, *more]) == 2
        told = capsys.readouterr().err
        assert words in told and told.count("\n") == 1


def test_its_schema_is_made_of_its_fields(capsys):
    assert main(["schema", "frequency"]) == 0
    schema = json.loads(capsys.readouterr().out)
    assert schema["$defs"]["Mode"]["properties"]["damping"]["description"] == "damping ratio ζ"
    numbers = schema["$defs"]["Response"]["properties"]["magnitude_dB"]
    assert numbers["items"] == {"anyOf": [{"type": "number"}, {"type": "null"}]}
