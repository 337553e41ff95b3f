"""`emaviz effects`: the user's own effects beside the library, and the library as pages."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import pytest
from support.documents import result_of

from ema_model.effects import CATALOGUE
from ema_model.effects.user.torque import KEYS
from emaviz.cli import main
from emaviz.text.html import mathml
from emaviz.views import effects as reference


def test_the_users_own_are_listed_and_explained(tmp_path, capsys):
    out = tmp_path / "e.json"
    assert main(["effects", "--json", str(out)]) == 0
    listed = capsys.readouterr().out
    names = [one["name"] for one in result_of(out, "effects")["effects"]]
    assert names == [*CATALOGUE, *KEYS] and all(name in listed for name in names)
    for name, keys in KEYS.items():
        assert main(["effects", name]) == 0
        told = capsys.readouterr().out
        assert all(key in told and meaning in told for key, meaning in keys.items())


def test_pages_are_written_where_they_can_be(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(reference, "CATALOGUE", {"hinge_moment": CATALOGUE["hinge_moment"]})  # all: tests/report
    folder = tmp_path / "pages"
    assert main(["effects", "--html", str(folder)]) == 0
    assert sorted(page.stem for page in folder.iterdir()) == sorted(["hinge_moment", "index", *KEYS])
    assert f"{2 + len(KEYS)} pages; begin with index.html" in capsys.readouterr().out
    (tmp_path / "file").write_text("")
    assert main(["effects", "--html", str(tmp_path / "file")]) == 2


@pytest.mark.parametrize("name", CATALOGUE)
def test_an_equation_is_well_formed_and_loses_no_letter(name):
    equation = CATALOGUE[name].equation
    root = ElementTree.fromstring(mathml(equation))
    shown = "".join(root.itertext())
    plain = re.sub(r"[\s_^{}/]", "", equation)
    assert re.sub(r"[\s/]", "", shown) == plain


def test_bars_enclose_what_they_are_around():
    text = mathml("T = c |ω| + a | b")
    assert '>|</mo><mi>ω</mi><mo form="postfix"' in text and "<mo>|</mo><mi>b</mi>" in text


def test_marks_are_set_below_above_and_over():
    text = mathml("T_f = σ_0 z e^{−s T} (1 − s T/2)")
    assert "<msub><mi>T</mi><mi>f</mi></msub>" in text and "<msub><mi>σ</mi><mn>0</mn></msub>" in text
    assert "<msup><mi>e</mi><mrow>" in text and "<mfrac><mi>T</mi><mn>2</mn></mfrac>" in text
