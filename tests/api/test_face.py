"""The package in a few functions, the README's example, and the notebooks."""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import ema_model as em
from ema_model.recordings import write_measurement
from ema_model.text import Document, Facts, Lines, Note, Remark, Remarks, Table
from emaviz.recording.writer import written
from emaviz.text.verdicts import shown

PROJECT = Path(__file__).parents[2]
NOTEBOOKS = sorted((PROJECT / "assets" / "notebooks").glob("*.ipynb"))


@pytest.fixture(scope="module")
def recording():
    return em.simulate("chirp", faults={"k1": 0.25}, duration_s=0.25, noise_A=0.1)


def test_a_recording_is_a_file_or_a_measurement_one_or_several(recording, tmp_path):
    path = tmp_path / "friction.csv"
    write_measurement(recording, path)
    answers = [em.compare(one, calibrate=False) for one in (path, str(path), recording, [em.read(path)])]
    errors = [one.signals["current_A"].rmse for one in answers]
    assert errors == pytest.approx([errors[0]] * 4, rel=1e-3)
    with pytest.raises(em.InputError, match="nowhere"):
        em.compare(tmp_path / "nowhere.csv")
    with pytest.raises(em.InputError, match="k9"):
        em.simulate(faults={"k9": 0.1})


@pytest.mark.parametrize(
    "given",
    [
        {"sample_rate_Hz": "fast"},
        {"duration_s": None},
        {"load_torque_Nm": [1.0, 2.0]},
        {"noise_A": "much"},
        {"encoder_bits": "many"},
        {"seed": "first"},
        {"seed": 1.5},
    ],
    ids=str,
)
def test_what_is_no_number_is_refused_in_one_line(given):
    with pytest.raises(em.InputError, match=r"must be a (whole )?number"):
        em.simulate(**{"duration_s": 0.01, **given})


@pytest.mark.parametrize(
    ("given", "kind"),
    [
        ({"faults": {"k1": "half"}}, "numbers by name"),
        ({"settings": {"amplitude_rad": "large"}}, "numbers by name"),
        ({"effects": {"cogging_torque": {"amplitude_Nm": "large"}}}, "settings by the effect's name"),
    ],
    ids=str,
)
def test_names_with_what_is_no_number_are_refused_in_one_line(given, kind):
    (option,) = given
    with pytest.raises(em.InputError, match=rf"^em\.simulate: {option} must be {kind}.*'(half|large)'") as caught:
        em.simulate(**{"duration_s": 0.01, **given})
    assert "\n" not in str(caught.value)


def test_units_are_compared_by_name():
    given = {name: em.simulate("chirp", duration_s=0.2, noise_A=0.3, seed=i) for i, name in enumerate("ab")}
    found = em.compare_units(given, free=["transmission.backlash_rad"])
    assert found.units == ("a", "b") and not found.differences
    assert "the 2 units do not differ" in str(found)
    with pytest.raises(em.InputError, match="one unit only"):
        em.compare_units({"a": given["a"]})


def test_one_of_several_that_is_too_short_is_left_out(recording, tmp_path):
    short = tmp_path / "short.csv"
    write_measurement(recording.selected((0.0, 0.005)), short)
    with pytest.warns(UserWarning, match=r"short\.csv: has 51 samples; .*; left out") as warned:
        found = em.compare([recording, short], calibrate=False)
    assert [one.filename for one in warned] == [__file__]
    assert [one.name for one in found.recordings] == ["chirp"]
    with pytest.raises(em.InputError, match=r"short\.csv: has 51 samples"):
        em.compare(short)


def test_what_is_fitted_is_not_held_out(recording, tmp_path):
    copy = tmp_path / "copy.csv"
    write_measurement(recording, copy)
    other = em.simulate("chirp", faults={"k1": 0.25}, duration_s=0.25, noise_A=0.1, seed=1)
    for same, line in ((recording, "chirp: is both fitted and held out"), (em.read(copy), "copy: is both .*of chirp")):
        for analysis in (em.compare, em.discover):
            with pytest.raises(em.InputError, match=line):
                analysis(recording, holdout=same)
        with pytest.raises(em.InputError, match=line):
            em.compare_units({"a": recording, "b": other}, holdout={"b": same})
    assert em.compare(recording, holdout=other, calibrate=False).holdout[0].name == "chirp"


def test_results_show_themselves(recording):
    answer = em.identify(recording)
    assert str(answer) == repr(answer) and re.search(r"^k1 +0\.2[0-9]+ .*not healthy$", str(answer), re.M)
    page = answer._repr_html_()
    assert "<table" in page and "not healthy: k1" in page


def test_what_is_shown_in_a_notebook_is_escaped():
    evil = "<script>alert(1)</script>"
    blocks = [Lines([evil], evil), Note(evil), Table((evil,), [[evil, evil]], evil, [evil], evil)]
    assert "<script" not in Document(blocks).html and Document(blocks).html.count("&lt;script&gt;") == 3 + 6


def test_a_recording_and_its_health_show_themselves(recording, tmp_path):
    assert re.search(r"^chirp: 2501 samples over 0\.250 s$", str(recording), re.M)
    assert re.search(r"^  motor_speed_rad_s +−\d+\.\d +\d+\.\d +rad/s$", str(recording), re.M)
    path = tmp_path / "log.csv"
    names = ["t [ms]", "target position [deg]", "actual position [deg]", "<b>shaft"]
    columns = zip(1e3 * recording["time_s"], *(recording[name] for name in ("command_rad", "user_position_rad") * 2))
    path.write_text("\n".join([",".join(names), *(",".join(f"{one:.9g}" for one in row[:4]) for row in columns)]))
    read = em.read(path)
    assert "from target position [deg]" in str(read) and "left aside: <b>shaft" in str(read)
    assert "&lt;b&gt;shaft" in read._repr_html_() and "<b>shaft" not in read._repr_html_()
    told = str(em.health(path)).splitlines()
    assert told[0] == "Data health log" and any(line.startswith("  ✓ No gaps") for line in told)
    assert [line.strip()[0] for line in told[1:]] == sorted((line.strip()[0] for line in told[1:]), key="▲●✓".index)


def test_a_table_is_aligned():
    table = Table(("fitted", "held out"), [["calibrated", "1.785", "2.345"], ["+ effect", "0.719", ""]], "ladder")
    assert table.text.splitlines() == [
        "ladder         fitted   held out",
        "  calibrated    1.785      2.345",
        "  + effect      0.719",
    ]


def test_every_block_is_shown_everywhere_and_escaped():
    blocks = [
        Lines(["a line of <b>", "another"], "lines"),
        Note("a note of <b>"),
        Remarks([Remark("a remark", "of <b>", "bad")]),
        Facts({"fact_of": "<b> 1"}, "facts", ["said of all"]),
        Table(("head",), [["row", "1.0 | <b>"]], "table", ["beside"], "in A", ["warning"]),
    ]
    told = Document(blocks)
    recording = written("title", blocks)
    for page in (told.html, "".join(shown(one) for one in blocks)):
        assert "<b>1" not in page and page.count("&lt;b&gt;") == 5
    assert recording.count("&lt;b>") == 5 and "1.0 \\| &lt;b>" in recording and r"fact\_of" in recording
    assert told.text.count("<b>") == 5
    for word in ("another", "a note", "a remark", "said of all", "beside", "in A", "head"):
        assert word in told.text and word in told.html and word in recording, word


def test_nothing_is_loaded_before_it_is_asked_for():
    told = "import sys, ema_model; print('numba' in sys.modules, 'compare' in dir(ema_model))"
    assert subprocess.check_output([sys.executable, "-c", told], text=True).split() == ["False", "True"]


def test_the_readmes_example_runs(recording, tmp_path, monkeypatch, capsys):
    readme = (PROJECT / "README.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```python\n(.*?)```", readme, re.S)
    assert len(example.strip().splitlines()) <= 6
    monkeypatch.chdir(tmp_path)
    write_measurement(recording, tmp_path / "friction.csv")
    exec(compile(example, "README.md", "exec"), {})
    assert "not healthy: k1" in capsys.readouterr().out


@pytest.mark.long
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path, tmp_path, monkeypatch):
    """Its cells in order; what ends a cell shows itself."""
    monkeypatch.chdir(tmp_path)
    notebook = json.loads(path.read_text(encoding="utf-8"))
    names: dict = {}
    shown: list = []
    for cell in (one for one in notebook["cells"] if one["cell_type"] == "code"):
        assert not cell["outputs"] and cell["execution_count"] is None, "outputs are not kept"
        tree = ast.parse("".join(cell["source"]))
        *body, last = tree.body
        exec(compile(ast.Module(body, []), path.name, "exec"), names)
        assert isinstance(last, ast.Expr), "a cell ends with what it shows"
        shown.append(eval(compile(ast.Expression(last.value), path.name, "eval"), names))
        assert re.search("<table|<p>|plotly", shown[-1]._repr_html_())
    SHOWS[path.stem](names, shown)


def broken_and_found(names, shown):
    assert [one.name for one in names["found"].effects] == ["cogging_torque"] and shown[-1].adequate


def log_compared(names, shown):
    read = shown[1].reading
    assert len(read.guessed) == 4 and [column for column, _ in read.mapping.unmapped] == ["Kanal 5"]
    assert "Kanal 5" in str(shown[1]) and "from Kanal 5" in str(shown[2])
    assert max(abs(names["recording"]["current_A"] - names["run"]["current_A"])) < 1e-8  # in A again
    assert "Data health bench" in str(shown[3]) and "●" in str(shown[3])
    assert names["result"].explained_by[0].variable == "user_position" and not names["result"].adequate
    without = shown[-1]
    assert "current_A" not in without.signals and without.explained_by[0].variable != "user_position"


def discovered(names, shown):
    assert [one.name for one in names["found"].effects] == ["load_dependent_friction"]
    before, after = (names[name].signals["current_A"] for name in ("before", "after"))
    assert after.rmse < 0.2 * before.rmse and names["after"].adequate and not names["before"].adequate


SHOWS = {"break_and_find": broken_and_found, "compare_a_log": log_compared, "discover": discovered}
