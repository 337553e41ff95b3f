"""`emaviz reproduce`: a small plan from the command to the report and the recording, and bad input in one line."""

from __future__ import annotations

import json
import re
import shutil

import numpy as np
import pytest
from support.documents import result_of
from test_campaign_command import Here

from ema_model.actuator import load_actuator
from ema_model.campaign import Store, thesis
from ema_model.campaign.thesis import BY_NAME, DEVIATIONS, Evaluation
from ema_model.commands import command
from ema_model.faults import NAMES, error_percent
from ema_model.simulation.run import Run
from emaviz.cli import main
from emaviz.recording import reproduce as recording
from emaviz.recording.read import read
from emaviz.views import reproduce as report

PLAN = """
[runs.short]
command = "chirp"
duration_s = 0.05

[groups.thesis]
does = "identify"
runs = "short"
faults = [{ k1 = 0.25 }]
algorithm = ["ssa", "hba", "do"]
population = 4
iterations = 2
parameters_known = true

[groups.filtered]
does = "identify"
runs = "short"
faults = [{ k1 = 0.25 }]
algorithm = "do"
population = 4
iterations = 2
parameters_known = true
"""


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    path = tmp_path_factory.mktemp("plan") / "tiny.toml"
    path.write_text(PLAN)
    return path


@pytest.fixture(scope="module")
def made(plan, tmp_path_factory):
    """The folder, and what was printed; computed here, with short responses."""
    folder = tmp_path_factory.mktemp("made") / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("ema_model.campaign.scheduler", lambda address, workers: Here())
        for name, settings in (("chirp", {}), ("step", {"time_s": 0.002})):
            patch.setitem(thesis.RUNS, name, Run(command(name, settings), 0.01))
        arguments = ["reproduce", "--plan", str(plan), "--out", str(folder), "--json", str(folder.parent / "r.json")]
        with pytest.MonkeyPatch.context() as without:  # severities, which take the longest to draw
            for module in (thesis, report, recording):
                without.setattr(module, "FAMILIES", ())
            assert main(arguments) == 0
        sizes = [(folder / name).stat().st_size for name in ("reproduce.html", "reproduce.rrd")]
        patch.setattr(Here, "outcomes", None)  # nothing is computed again
        assert main(arguments) == 0
        assert all(
            (folder / name).stat().st_size > size for name, size in zip(("reproduce.html", "reproduce.rrd"), sizes)
        )
    return folder


def figures_of(html):
    return json.loads(re.search(r'id="figures">(.*?)</script>', html, re.S).group(1))["figures"]


@pytest.mark.long
def test_the_result_follows_from_the_rows(made):
    told = result_of(made.parent / "r.json", "reproduce")
    found = Evaluation(Store(made))
    assert json.loads(json.dumps(found.to_dict(), allow_nan=False)).items() <= told.items()
    assert "mean Err" in str(found) and "<table" in found._repr_html_()
    rows = {(one["case"], one["algorithm"]): one for one in told["rows"]}
    kept = [row for row in Store(made).table("identify", how=True).to_pylist() if row["group"] == "thesis"]
    assert {row["algorithm"] for row in kept} == {"ssa", "hba", "do"}
    truth = BY_NAME["friction_low"].k
    for row in kept:
        one = rows["friction_low", row["algorithm"]]
        assert one["runs"] == 1 and one["error_deviation_percent"] is None
        assert one["error_percent"] == pytest.approx(error_percent([row[name] for name in NAMES], truth))
        assert one["error_wrapped_percent"] == row["error_wrapped_percent"] and one["time_s"] == row["answer_s"] > 0.0
        assert len(row["error_history_percent"]) == len(row["rmse_history_A"]) == 3
        assert row["error_history_percent"][-1] == pytest.approx(row["error_percent"])
    assert rows["friction_low", "ssa"]["thesis_error_percent"] == pytest.approx(0.689)
    assert rows["multiple", "hba"]["error_percent"] is None and rows["multiple", "hba"]["thesis_time_s"] == 1743
    assert told["performance_coefficient_percent"] == []  # friction is low and high


def test_the_report_holds_everything_and_asks_no_network(made):
    html = (made / "reproduce.html").read_text(encoding="utf-8")
    sections = re.findall(r'<section id="(\w+)">', html)
    assert sections == [one.anchor for one in report.VIEW.sections if one.anchor != "coefficients"]
    assert "0.69 ± 0.12" in html and "2709" in html  # T 5.1, T 5.11
    assert html.count("<tr><td") >= 33 + len(DEVIATIONS)
    assert "default-src 'none'" in html and "Nothing has been computed" not in html
    figures = figures_of(html)
    titles = [figure["layout"]["title"]["text"] for figure in figures]
    assert (
        len([title for title in titles if "chirp" in title or "step" in title]) == 30
    )  # 5 faults × 2 runs × 3 signals
    assert len([title for title in titles if "healthy" in title]) == 4
    for figure, title in zip(figures, titles):
        if title.startswith("<b>Mean error"):
            continue  # a row a case
        for axis in ("xaxis", "yaxis"):
            assert figure["layout"][axis]["title"]["text"], title
        assert re.search(r"\[.+\]|share", figure["layout"]["yaxis"]["title"]["text"]), title


def test_the_recording_holds_what_the_report_draws(made):
    found = read(made / "reproduce.rrd")
    assert found.complete
    told = found.properties["reproduce"]
    assert {one["algorithm"] for one in told["rows"]} == {"ssa", "hba", "do"}
    content = (made / "reproduce.rrd").read_bytes()
    for place in ("convergence/friction_low/hba/median", "models/faulty/current_A", "severities/gain/step", "tables"):
        assert f"/reproduce/{place}".encode() in content


def test_responses_are_those_of_the_models(made):
    """Both models on one time base; a fault that is not there changes nothing, a greater one more."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(thesis.RUNS, "chirp", Run(command("chirp"), 0.02))
        family = next(one for one in thesis.FAMILIES if one.name == "friction")
        runs = list(thesis.responses(family, "chirp", load_actuator()).values())
        healthy, faulty = thesis.pairs(load_actuator())
    peaks = [float(np.max(np.abs(one["current_A"]))) for one in runs]
    assert peaks == sorted(peaks) and peaks[-1] > 1.5 * peaks[0]
    np.testing.assert_array_equal(runs[0]["current_A"], healthy.reference["current_A"])
    assert 0.0 < healthy.rms_difference("current_A") < 1.0
    assert np.any(faulty.reference["current_A"] != healthy.reference["current_A"])


def one_line(arguments, capsys):
    assert main([str(one) for one in arguments]) == 2
    told = capsys.readouterr().err
    assert told.startswith("emaviz: ") and told.count("\n") == 1 and told.rstrip().isprintable(), told
    return told


def test_bad_input_is_one_line(plan, tmp_path, capsys):
    assert "--out" in one_line(["reproduce"], capsys)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "notes.txt").write_text("mine")
    assert "holds other files" in one_line(["reproduce", "--plan", plan, "--out", tmp_path / "full"], capsys)
    (tmp_path / "file").write_text("mine")
    one_line(["reproduce", "--plan", plan, "--out", tmp_path / "file"], capsys)
    one_line(["reproduce", "--plan", plan, "--quick", "--out", tmp_path / "new"], capsys)
    other = tmp_path / "other.toml"
    other.write_text('[groups.a]\ndoes = "track"\nlaw = "linear"\n')
    assert "identifies nothing" in one_line(["reproduce", "--plan", other, "--out", tmp_path / "new"], capsys)
    assert not (tmp_path / "new").exists()


def test_a_folder_of_another_version_stays_as_it_is(plan, made, tmp_path, capsys):
    shutil.copytree(made, tmp_path / "out")
    header = tmp_path / "out" / "campaign.json"
    told = json.loads(header.read_text())
    told["version"]["sources"] = "0" * 12
    header.write_text(json.dumps(told))
    line = one_line(["reproduce", "--plan", plan, "--out", tmp_path / "out"], capsys)
    assert "made by another version" in line
    assert (tmp_path / "out" / "reproduce.html").read_bytes() == (made / "reproduce.html").read_bytes()
