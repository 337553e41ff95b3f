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
from ema_model.discovery import Discovery
from ema_model.recordings import write_measurement
from ema_model.text import Document, Lines, Note, Table

PROJECT = Path(__file__).parents[2]
NOTEBOOKS = sorted((PROJECT / "assets" / "notebooks").glob("*.ipynb"))


@pytest.fixture(scope="module")
def recording():
    return em.simulate("chirp", faults={"k1": 0.25}, noise_A=0.1)


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


def test_results_show_themselves(recording):
    answer = em.identify(recording)
    assert str(answer) == repr(answer) and re.search(r"^k1 +0\.2[0-9]+ .*not healthy$", str(answer), re.M)
    page = answer._repr_html_()
    assert "<table" in page and "not healthy: k1" in page


def test_what_is_shown_in_a_notebook_is_escaped():
    evil = "<script>alert(1)</script>"
    blocks = [Lines([evil], evil), Note(evil), Table((evil,), [[evil, evil]], evil, [evil], evil)]
    assert "<script" not in Document(blocks).html and Document(blocks).html.count("&lt;script&gt;") == 3 + 6


def test_a_table_is_aligned():
    table = Table(("fitted", "held out"), [["calibrated", "1.785", "2.345"], ["+ effect", "0.719", ""]], "ladder")
    assert table.text.splitlines() == [
        "ladder         fitted   held out",
        "  calibrated    1.785      2.345",
        "  + effect      0.719",
    ]


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


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path):
    """Its cells in order; what ends a cell shows itself."""
    cells = [cell for cell in json.loads(path.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]
    names: dict = {}
    for cell in cells:
        tree = ast.parse("".join(cell["source"]))
        *body, last = tree.body
        exec(compile(ast.Module(body, []), path.name, "exec"), names)
        assert isinstance(last, ast.Expr), "a cell ends with what it shows"
        shown = eval(compile(ast.Expression(last.value), path.name, "eval"), names)
        assert "<table" in shown._repr_html_()
    if isinstance(names.get("found"), Discovery):
        assert [one.name for one in names["found"].effects] == ["cogging_torque"]
        assert shown.adequate
